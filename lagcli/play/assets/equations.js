"use strict";

/*
 * The equations of the model, with the balance of their terms, and buttons that cut constraints.
 *
 *   const equations = new LiveEquations(element, {link, focus, wanted, now});
 *   equations.build(html, colors);   // of another model
 *   equations.request();             // what a request says: {balance, cuts}
 *   equations.draw(answer.balance);
 *
 * `wanted` is called when another run is needed, `now` returns the time that the page shows. A constraint
 * that is cut does not act from that time on; cutting it again restores it.
 */

class LiveEquations {
  static SHORT = 3; // so many are shown from the beginning

  constructor(element, { link, focus, wanted, now }) {
    Object.assign(this, { element, link, focus, wanted, now });
    this.cuts = {};
    this.balances = null;
    element.addEventListener("toggle", () => {
      if (element.open && !this.balances) wanted();
    });
  }

  build(html, colors) {
    const { element } = this;
    element.hidden = !html;
    element.querySelector("div")?.remove();
    element.insertAdjacentHTML("beforeend", `<div>${html}</div>`);
    this.#show(element.querySelectorAll(".live").length);
    [this.colors, this.balances] = [colors, null];
    const buttons = [...element.querySelectorAll("[data-cut]")];
    const names = new Set(buttons.map(({ dataset }) => dataset.cut));
    for (const name of Object.keys(this.cuts)) if (!names.has(name)) delete this.cuts[name];
    for (const button of buttons) {
      button.style.setProperty("--term", colors[button.dataset.cut]);
      button.addEventListener("click", (event) => this.#cut(button, event));
    }
    for (const sign of element.querySelectorAll(".cuttable [data-constraint], .cuttable > span")) {
      const key = Focus.constraint(sign.dataset.constraint ?? sign.textContent);
      sign.addEventListener("pointerenter", () => this.focus.point(key));
      sign.addEventListener("pointerleave", () => this.focus.point());
    }
    this.#mark(buttons);
  }

  /** Unfold few equations, once: later it is as the reader wants it. */
  #show(count) {
    this.shown ??= this.element.open = count > 0 && count <= LiveEquations.SHORT;
  }

  /** Whether a constraint is cut. */
  get cut() {
    return Object.keys(this.cuts).length > 0;
  }

  request() {
    return { balance: this.element.open, cuts: this.cuts };
  }

  /** Show the terms of a run; null if the answer has none. */
  draw(data) {
    if (!data) return;
    const { element, link, focus, colors } = this;
    if (this.balances) {
      for (const [i, balance] of this.balances.entries()) balance.setData(data.equations[i], data.time);
      return;
    }
    this.balances = data.equations.map((equation) => {
      const place = element.querySelector(`.live[data-coordinate="${CSS.escape(equation.coordinate)}"]`);
      return new Balance(place, equation, data.time, { link, focus, colors });
    });
  }

  /** Take all constraints as they are in the model. */
  restore() {
    this.cuts = {};
    this.#mark([...this.element.querySelectorAll("[data-cut]")]);
  }

  #cut(button, event) {
    const name = button.dataset.cut;
    if (name in this.cuts) delete this.cuts[name];
    else this.cuts[name] = this.now();
    this.#mark([button]);
    this.wanted(event);
  }

  #mark(buttons) {
    for (const button of buttons) {
      const time = this.cuts[button.dataset.cut];
      button.setAttribute("aria-pressed", String(time !== undefined));
      button.textContent = time === undefined ? "Cut" : `Restore (cut at ${PlotNumbers.value(time)} s)`;
      button.setAttribute("aria-label", `${button.textContent}: ${button.dataset.cut}`);
    }
  }
}
