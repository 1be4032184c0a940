"use strict";

/*
 * The page of a report: plots and animation on one time, light and dark, print.
 *
 * Needs uPlot, the player's scripts, plots.js, arms.js and balance.js; the numbers are in the page's #data:
 * {name, instants, palette, colors: {CONSTRAINT: colour}, arms: {CONSTRAINT: unit}, scene, speed, arrays: [base64 of doubles],
 * plots: [see plots.js, with places in arrays], balance: {time, equations: [see balance.js]} with places
 * in arrays, or null, marks: [times of contacts and events]}.
 */

(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const find = (selector) => document.querySelector(selector);

  const arrays = data.arrays.map((text) => {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    return new Float64Array(bytes.buffer);
  });

  const theme = new PageTheme(); // before the plots, which read its colours

  const instants = arrays[data.instants];
  const link = new TimeLink(instants);
  const focus = new Focus();
  const places = [...document.querySelectorAll(".place figure")];
  const plots = data.plots.map((plot, i) => {
    const series = plot.series.map((s) => ({
      ...Focus.curve(s, plot, data.colors),
      values: arrays[s.values],
    }));
    const whole = { ...plot, time: arrays[plot.time], marks: data.marks, series };
    return new TimePlot(places[i], whole, { link, focus, palette: data.palette, height: plot.height });
  });

  let player = null;
  if (data.scene) {
    player = new Player(find("#player"), data.scene, {
      label: data.name,
      speed: data.speed,
      instants,
      onTime: (time) => link.setTime(time, player),
    });
    link.onTime((time, source) => {
      if (source === player) return;
      player.setTime(time);
      player.pause();
    });
  }
  if (plots.length) link.setTime(plots[0].data.time[0]);

  // λ beneath the mechanism, on the same time
  const below = find("#lambda");
  const first = data.plots.findIndex((plot) => plot.by_constraint);
  if (below && first >= 0) {
    const { data: shown } = plots[first];
    plots.push(new TimePlot(below, shown, { link, focus, palette: data.palette, height: 150 }));
  }

  if (below && first >= 0) {
    const arms = new LeverArms(find("#arms"), link);
    const whole = data.plots.map((plot, i) => ({ ...plot, ...plots[i].data })).filter(({ by_constraint }) => by_constraint);
    arms.setData(data.scene, whole, data.arms);
  }

  const balances = (data.balance?.equations ?? []).map((equation) => {
    const terms = equation.terms.map((term) => ({ ...term, values: arrays[term.values] }));
    const place = find(`.live[data-coordinate="${CSS.escape(equation.coordinate)}"]`);
    const time = arrays[data.balance.time];
    return new Balance(place, { ...equation, terms }, time, { link, focus, colors: data.colors });
  });

  // λ of a constraint, its arrow, its curve and its terms
  for (const sign of document.querySelectorAll("[data-constraint]")) {
    if (sign.closest(".term")) continue;
    const key = Focus.constraint(sign.dataset.constraint);
    sign.addEventListener("pointerenter", () => focus.point(key));
    sign.addEventListener("pointerleave", () => focus.point());
    focus.onChange(() => sign.classList.toggle("lit", focus.has(key)));
  }
  if (player) focus.attach(player.stage);

  // a motion that plays is not carried off by a mouse that passes over a plot
  if (player) Object.defineProperty(link, "free", { get: () => !player.playing });

  for (const button of document.querySelectorAll("button[data-time]")) {
    button.addEventListener("click", () => link.setTime(Instants.after(instants, Number(button.dataset.time))));
  }

  const zoomOut = find("#zoom-out");
  link.onRange((range) => (zoomOut.hidden = range === null));
  zoomOut.addEventListener("click", () => link.setRange(null));

  theme.onPaint = () => {
    for (const plot of [...plots, ...balances]) plot.recolour();
    player?.stage.restyle();
  };
  theme.onPaint();

  // On paper: light, plots two in a row, four pictures in place of the animation.
  const strip = find(".strip");
  const STILLS = 4;
  const stills = [];

  /** The times at which the mechanism looks most different, the first among them. */
  const differing = (scene, count) => {
    const moving = Object.values(scene.points)
      .flat()
      .filter((series) => series.length > 1);
    const distance = (a, b) =>
      moving.reduce((sum, series) => sum + (series[a] - series[b]) ** 2, 0);
    const chosen = [0];
    const nearest = scene.time.map((_, i) => distance(i, 0));
    while (chosen.length < count) {
      const farthest = Math.max(...nearest);
      if (!(farthest > 0)) break; // it stands still
      const next = nearest.indexOf(farthest);
      chosen.push(next);
      nearest.forEach((d, i) => (nearest[i] = Math.min(d, distance(i, next))));
    }
    return chosen.sort((a, b) => a - b).map((i) => scene.time[i]);
  };

  const drawStrip = () => {
    if (!strip || !player) return;
    const times = differing(data.scene, STILLS);
    for (const [i, time] of times.entries()) {
      if (!stills[i]) {
        const figure = document.createElement("figure");
        const canvas = document.createElement("canvas");
        const caption = document.createElement("figcaption");
        caption.textContent = `t = ${Number(time.toPrecision(4))} s`;
        figure.append(canvas, caption);
        strip.append(figure);
        stills[i] = new Scene(canvas, data.scene);
      }
      stills[i].resize();
      stills[i].draw(time);
    }
  };
  theme.onPrint = (printing) => {
    for (const plot of plots) {
      if (printing) plot.resize(330, plot.data.log ? 110 : 165);
      else plot.resize();
    }
    if (printing) drawStrip();
  };
})();
