"use strict";

/*
 * The page of a report: plots and animation on one time, light and dark, print.
 *
 * Needs uPlot, the player's scripts and plots.js; the numbers are in the page's #data:
 * {name, palette, scene, speed, arrays: [base64 of doubles], plots: [see plots.js, with places in arrays]}.
 */

(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const find = (selector) => document.querySelector(selector);
  const root = document.documentElement;

  const arrays = data.arrays.map((text) => {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    return new Float64Array(bytes.buffer);
  });

  const dark = matchMedia("(prefers-color-scheme: dark)");
  root.dataset.theme = dark.matches ? "dark" : "light";

  const link = new TimeLink();
  const places = [...document.querySelectorAll(".place figure")];
  const plots = data.plots.map((plot, i) => {
    const series = plot.series.map((s) => ({ ...s, values: arrays[s.values] }));
    const whole = { ...plot, time: arrays[plot.time], series };
    return new TimePlot(places[i], whole, { link, palette: data.palette, height: 220 });
  });

  let player = null;
  if (data.scene) {
    player = new Player(find("#player"), data.scene, {
      label: data.name,
      speed: data.speed,
      onTime: (time) => link.setTime(time, player),
    });
    link.onTime((time, source) => {
      if (source === player) return;
      player.pause();
      player.setTime(time);
    });
  }
  if (plots.length) link.setTime(plots[0].data.time[0]);

  // a motion that plays is not carried off by a mouse that passes over a plot
  if (player) Object.defineProperty(link, "free", { get: () => !player.playing });

  for (const button of document.querySelectorAll("button[data-time]")) {
    button.addEventListener("click", () => link.setTime(Number(button.dataset.time)));
  }

  const zoomOut = find("#zoom-out");
  link.onRange((range) => (zoomOut.hidden = range === null));
  zoomOut.addEventListener("click", () => link.setRange(null));

  const theme = find("#theme");
  const paint = (name) => {
    root.dataset.theme = name;
    theme.textContent = name === "dark" ? "Light" : "Dark";
    for (const plot of plots) plot.recolour();
    player?.stage.restyle();
  };
  const next = () => (root.dataset.theme === "dark" ? "light" : "dark");
  theme.hidden = false;
  theme.addEventListener("click", () => paint(next()));
  dark.addEventListener("change", () => paint(dark.matches ? "dark" : "light"));
  paint(root.dataset.theme);

  // On paper: light, plots two in a row, six pictures in place of the animation.
  const strip = find(".strip");
  const STILLS = 6;
  const stills = [];
  const drawStrip = () => {
    if (!strip || !player) return;
    const { start, end } = player;
    for (let i = 0; i < STILLS; i++) {
      const time = start + ((end - start) * i) / (STILLS - 1);
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
  let before = null;
  addEventListener("beforeprint", () => {
    if (before) return;
    before = { theme: root.dataset.theme, open: find("#model details").open };
    root.classList.add("printing");
    find("#model details").open = true;
    paint("light");
    for (const plot of plots) plot.resize(335, 165);
    drawStrip();
  });
  addEventListener("afterprint", () => {
    if (!before) return;
    root.classList.remove("printing");
    find("#model details").open = before.open;
    paint(before.theme);
    for (const plot of plots) plot.resize();
    before = null;
  });
})();
