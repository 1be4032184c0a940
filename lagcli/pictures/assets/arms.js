"use strict";

/*
 * Lever arms: where the arrow of a force is not as long as λ, what λ is multiplied by.
 *
 *   const arms = new LeverArms(element, link);
 *
 *   arms.setData(scene, plots, units);   // of a run
 *
 * `plots` are those of λ, whose series have a `constraint`; `units` are those of the arms, by
 * constraint. Needs plots.js and motion.js.
 */

class LeverArms {
  static SAME = 1e-6; // of λ: a smaller difference is rounding
  static SMALL = 1e-6; // of the largest λ: below it, the quotient says nothing
  static MOST = 6; // arrows

  constructor(element, link) {
    this.element = element;
    this.lines = [];
    link.onTime((time) => this.#show(time));
  }

  setData(scene, plots, units) {
    const motion = new Motion(scene);
    const multipliers = plots.flatMap(({ time, series }) => series.map((x) => ({ ...x, time })));
    const named = new Map();
    for (const shape of scene.shapes) {
      const [constraint] = shape.parts ?? [];
      if (shape.quantity !== "force" || shape.parts.length !== 1 || named.has(shape.name)) continue;
      const series = multipliers.find((x) => x.constraint === constraint);
      if (series && constraint in units) named.set(shape.name, { shape, series, unit: units[constraint] });
    }
    const every = [...named].map(([name, line]) => ({ name, ...line, arm: this.#arm(motion, line) }));
    const times = scene.time;
    const other = ({ arm }) => times.some((time) => Math.abs(arm(time) - 1) > LeverArms.SAME);
    this.lines = every.filter(other).slice(0, LeverArms.MOST);
    this.element.hidden = !this.lines.length;
    const said = document.createElement("p");
    said.textContent = "Arrows are forces: λ is multiplied by an arm.";
    const list = document.createElement("ul");
    for (const line of this.lines) {
      line.item = document.createElement("li");
      list.append(line.item);
    }
    this.element.replaceChildren(said, list);
    this.#show(times[0]);
  }

  /** Return the arm as a function of the time: |F|/|λ|; NaN where λ is 0. */
  #arm(motion, { shape, series }) {
    const largest = series.values.reduce((m, x) => Math.max(m, Math.abs(x) || 0), 0);
    return (time) => {
      motion.seek(time);
      const multiplier = Math.abs(TimePlot.at(series.time, series.values, time));
      const force = Math.hypot(...motion.vector(shape.components));
      return multiplier > LeverArms.SMALL * largest ? force / multiplier : NaN;
    };
  }

  #show(time) {
    for (const { name, series, unit, arm, item } of this.lines) {
      const now = arm(time);
      item.hidden = Number.isNaN(now); // where λ is 0
      const value = PlotNumbers.value(Number(now.toPrecision(4)));
      const shown = unit && unit !== "1" ? `${value} ${unit}` : value;
      item.replaceChildren(`|${name}| = ${shown} · |`, TimePlot.named(series.label), "|");
    }
  }
}
