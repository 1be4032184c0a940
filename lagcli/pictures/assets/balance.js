"use strict";

/*
 * The balance of an equation of motion: a bar for each side, in which the terms are stacked with their
 * signs, and their values. At each instant both sides have the same sum.
 *
 * Needs plots.js and balance.css. The terms are the elements with `data-term` of the formula.
 *
 *   const balance = new Balance(element, equation, time, {link, focus, colors});
 *
 *   balance.setData(equation, time);      // of another run
 *
 * `element` contains the formula; the balance is added to it. `equation` is what
 * lagcli/pictures/balance.py describes, and `colors` has the colour of each constraint. A term of one
 * constraint has the key of the constraint, every other one its own; see Focus.
 */

class Balance {
  static SIDES = ["left side", "right side"];
  static KINDS = {
    inertia: "inertia",
    potential: "potential forces",
    applied: "applied forces",
    constraint: "constraint forces",
  };

  constructor(element, equation, time, { link, focus, colors }) {
    [this.element, this.equation, this.time] = [element, equation, time];
    [this.link, this.focus, this.colors] = [link, focus, colors];
    this.terms = equation.terms.map((term, i) => ({
      ...term,
      key: term.constraint ? Focus.constraint(term.constraint) : Focus.term(equation.coordinate, i),
      color: this.#color(term, i),
      nodes: [...element.querySelectorAll(`[data-term="${i}"]`)],
    }));
    element.balance = this; // to be found from the page
    this.#scale();
    this.#build();
    link.onTime((now) => this.show(now));
    focus.onChange(() => this.#emphasize());
    // balances that are out of sight need not follow
    new IntersectionObserver(([entry]) => {
      this.seen = entry.isIntersecting;
      if (this.seen) this.show(link.time);
    }).observe(element);
    this.show(link.time);
  }

  /** Show the values at a time, s. */
  show(now) {
    if (now === null || this.seen === false) return;
    const values = this.terms.map(({ values }) =>
      values.length === 1 ? values[0] : TimePlot.at(this.time, values, now),
    );
    const sums = [0, 0];
    const ends = [
      [0, 0],
      [0, 0],
    ]; // of each side: the ends of its negative and of its positive stack
    for (const [i, term] of this.terms.entries()) {
      const value = Number.isFinite(values[i]) ? values[i] : 0;
      const stack = ends[term.side];
      const end = Number(value > 0);
      const [from, to] = [stack[end], stack[end] + value].sort((a, b) => a - b);
      stack[end] += value;
      sums[term.side] += value;
      const [left, right] = [this.#place(from), this.#place(to)];
      term.segment.style.left = `${left}%`;
      term.segment.style.width = `${right - left}%`;
      term.shown.textContent = this.#written(values[i]);
    }
    for (const [side, mark] of this.marks.entries()) mark.style.left = `${this.#place(sums[side])}%`;
    this.residual.textContent = Balance.#rounded(sums[0] - sums[1]);
    this.now = { values, sums };
  }

  /** Return a number with one digit. */
  static #rounded(value) {
    return value === 0 ? "0" : PlotNumbers.typeset(value.toExponential(0));
  }

  /** Take the values of another run. */
  setData(equation, time) {
    this.time = time;
    for (const [i, { values }] of equation.terms.entries()) this.terms[i].values = values;
    this.#scale();
    for (const zero of this.zeros) zero.style.left = `${this.#place(0)}%`;
    if (this.plot) this.plot.setData({ time, series: this.#series() });
    this.show(this.link.time ?? time[0]);
  }

  #color({ kind, constraint }, i) {
    if (constraint && this.colors[constraint]) return this.colors[constraint];
    const alike = this.equation.terms.slice(0, i).filter((term) => term.kind === kind).length;
    return `--term-${kind}-${alike % 2}`;
  }

  /** Find the smallest and the largest stack of the run. */
  #scale() {
    let [low, high] = [0, 0];
    for (let i = 0; i < this.time.length; i++) {
      const stacks = [0, 0, 0, 0];
      for (const { side, values } of this.terms) {
        const value = values.length === 1 ? values[0] : values[i];
        if (Number.isFinite(value)) stacks[2 * side + Number(value > 0)] += value;
      }
      low = Math.min(low, stacks[0], stacks[2]);
      high = Math.max(high, stacks[1], stacks[3]);
    }
    this.range = high > low ? [low, high] : [-1, 1];
  }

  #place(value) {
    const [low, high] = this.range;
    return Math.max(0, Math.min(100, ((value - low) / (high - low)) * 100));
  }

  #written(value) {
    const { unit } = this.equation;
    const [low, high] = this.range;
    const rounding = Math.abs(value) < 1e-12 * Math.max(-low, high);
    const text = PlotNumbers.value(rounding ? 0 : Number(value.toPrecision(4)));
    return unit && unit !== "1" ? `${text} ${unit}` : text;
  }

  #build() {
    const make = (tag, kind, parent, text) => {
      const part = document.createElement(tag);
      part.className = kind;
      if (text !== undefined) part.textContent = text;
      parent.append(part);
      return part;
    };
    const { equation, element } = this;
    const box = document.createElement("div");
    box.className = "balance";
    const bars = make("div", "balance-bars", box);
    bars.setAttribute("role", "img");
    bars.setAttribute(
      "aria-label",
      `The terms of the equation of ${equation.label}, stacked: both sides have the same sum`,
    );
    [this.marks, this.zeros] = [[], []];
    this.bars = Balance.SIDES.map((name) => {
      make("span", "balance-side", bars, name);
      const bar = make("div", "balance-bar", bars);
      const zero = make("span", "balance-zero", bar);
      zero.style.left = `${this.#place(0)}%`;
      this.zeros.push(zero);
      this.marks.push(make("span", "balance-sum", bar));
      return bar;
    });
    const list = make("ul", "balance-terms", box);
    for (const term of this.terms) {
      term.segment = make("span", `balance-segment ${term.kind}`, this.bars[term.side]);
      const item = make("li", "", list);
      const button = make("button", `balance-key ${term.kind}`, item);
      button.type = "button";
      make("span", "balance-swatch", button);
      this.#label(term, make("span", "balance-label", button));
      const kind = Balance.KINDS[term.kind];
      make("span", "balance-kind", button, term.constraint ? `constraint ${term.constraint}` : kind);
      term.shown = make("span", "balance-value", button);
      term.button = button;
      button.setAttribute("aria-pressed", "false");
      button.title = "Emphasize this term, its arrow and its curve";
      button.addEventListener("click", () => this.focus.pin(term.key));
      const parts = [...term.nodes, term.segment, button];
      for (const part of parts) {
        part.style.setProperty("--term", term.color.startsWith("--") ? `var(${term.color})` : term.color);
        part.addEventListener("pointerenter", () => this.focus.point(term.key));
        part.addEventListener("pointerleave", () => this.focus.point());
      }
      for (const part of term.nodes) part.addEventListener("click", () => this.focus.pin(term.key));
      button.addEventListener("focus", () => this.focus.hold(term.key));
      button.addEventListener("blur", () => this.focus.hold());
    }
    const rest = make("p", "balance-rest", box, "left − right = ");
    this.residual = make("span", "balance-value", rest);
    if (equation.unit && equation.unit !== "1") rest.append(` ${equation.unit}`);
    this.#curves(make("details", "balance-curves", box), make);
    element.append(box);
  }

  /** Write a term: as in the equation, if it is short. */
  #label({ label, nodes }, place) {
    if (label.endsWith("…")) {
      place.textContent = label;
      return;
    }
    const formula = document.createElementNS("http://www.w3.org/1998/Math/MathML", "math");
    for (const node of nodes) {
      const copy = node.cloneNode(true);
      copy.removeAttribute("data-term");
      copy.removeAttribute("class");
      formula.append(copy);
    }
    if (label.startsWith("−")) place.append("−");
    place.append(formula);
  }

  /** The terms over the time, drawn when they are asked for. */
  #curves(details, make) {
    make("summary", "", details, "Terms over time");
    const figure = make("figure", "", details);
    details.addEventListener("toggle", () => {
      if (!details.open || this.plot) return;
      const { time, equation, link, focus } = this;
      const data = { time, unit: equation.unit, symbol: "terms", series: this.#series() };
      this.plot = new TimePlot(figure, data, { link, focus });
    });
  }

  #series() {
    const whole = (values) =>
      values.length > 1 ? values : new Float64Array(this.time.length).fill(values[0]);
    return this.terms.map(({ label, values, color, key }, i) => ({
      ...{ name: String(i), label: label.replaceAll("_", " "), color, key },
      values: whole(values),
    }));
  }

  /** Take the page's colours again. */
  recolour() {
    this.plot?.recolour();
  }

  #emphasize() {
    const { focus } = this;
    this.element.classList.toggle(
      "emphasized",
      this.terms.some(({ key }) => focus.has(key)),
    );
    for (const { key, nodes, segment, button } of this.terms) {
      for (const part of [...nodes, segment, button]) part.classList.toggle("lit", focus.has(key));
      button.setAttribute("aria-pressed", String(key === focus.pinned));
    }
  }
}
