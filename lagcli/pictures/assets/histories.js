"use strict";

/*
 * Histories: coordinates over the time, a stage for the player where a model has no view.
 *
 * Needs uPlot, instants.js and plots.js. The data:
 *
 *   {time: [nt], palette: […], plots: [{title, unit, series: [{name, label, values: [nt]}]}]}
 */

class Histories {
  static LEAST = 220; // height of a plot, CSS pixels
  static BESIDE = 44; // of its legend and margins
  static PAPER = 640; // width of a plot
  /**
   * @param {HTMLElement} element  is filled
   * @param {object} data
   */
  constructor(element, data) {
    this.target = element;
    this.subject = "Coordinates over time";
    element.classList.add("player-plots");
    element.setAttribute("role", "group");
    new ResizeObserver(() => this.#fill()).observe(element);
    this.link = new TimeLink();
    this.link.free = false; // the player moves the time, or a click
    this.link.onTime((time, source) => source !== this && this.onSeek?.(time));
    this.setScene(data);
  }

  /** Take other data. */
  setScene(data) {
    this.motion = { time: data.time, start: data.time[0], end: data.time[data.time.length - 1] };
    this.link.instants = data.time;
    this.target.replaceChildren();
    this.plots = data.plots.map((plot) => {
      const figure = document.createElement("figure");
      this.target.append(figure);
      const { link } = this;
      return new TimePlot(figure, { time: data.time, ...plot }, { link, palette: data.palette });
    });
  }

  /** Take the page's colours again. */
  restyle() {
    for (const plot of this.plots) plot.recolour();
  }

  /** Take the width of paper, or fill the stage again. */
  print(printing) {
    this.printing = printing;
    this.#fill();
  }

  #fill() {
    const { target, plots } = this;
    const room = target.clientHeight / plots.length - Histories.BESIDE;
    for (const plot of plots) {
      plot.height = this.printing ? Histories.LEAST : Math.max(Histories.LEAST, room);
      plot.resize(this.printing ? Histories.PAPER : plot.container.clientWidth);
    }
  }

  /** Show where the coordinates are at a time, s. */
  draw(time) {
    this.link.setTime(time, this);
  }
}
