"use strict";

/*
 * Phase plane: a velocity over its coordinate, with the place of the time that is shown.
 *
 *   const phase = new PhasePlane(element, link, palette, () => ask());
 *   phase.draw(plots, kept);      // plots of the groups `coordinates` and `velocities`
 */

class PhasePlane {
  static GROUPS = ["coordinates", "velocities"];
  static HEIGHT = 260;
  static ROOM = 34; // for the axes, CSS pixels

  constructor(element, link, palette, wanted) {
    this.palette = palette;
    this.details = document.createElement("details");
    this.details.className = "phase";
    this.select = document.createElement("select");
    this.select.setAttribute("aria-label", "Coordinate of the phase plane");
    this.canvas = document.createElement("canvas");
    this.canvas.setAttribute("role", "img");
    this.details.append(Row.text("summary", "", "Phase plane"), this.select, this.canvas);
    element.append(this.details);
    this.details.addEventListener("toggle", () => (this.details.open ? wanted() : null));
    this.select.addEventListener("change", () => this.#paint());
    link.onTime((time) => {
      this.time = time;
      this.#paint();
    });
    new ResizeObserver(() => this.#paint()).observe(this.details);
  }

  /** The groups of curves that it needs now. */
  groups() {
    return this.details.open ? PhasePlane.GROUPS : [];
  }

  /** Take a run, and one that was kept. */
  draw(plots, kept) {
    [this.plots, this.kept] = [plots, kept];
    const [q] = PhasePlane.GROUPS.map((group) => plots[group]?.series ?? []);
    const labels = q.map(({ label }) => label);
    if (labels.join() !== [...this.select.options].map(({ text }) => text).join()) {
      this.select.replaceChildren(...labels.map((label, i) => new Option(label, String(i))));
    }
    this.#paint();
  }

  #curve(plots) {
    const i = this.select.selectedIndex;
    const [q, v] = PhasePlane.GROUPS.map((group) => plots?.[group]?.series[i]);
    return q && v ? { q, v, time: plots.coordinates.time } : null;
  }

  #paint() {
    const curve = this.#curve(this.plots);
    const width = this.canvas.clientWidth;
    if (!this.details.open || !curve || !width) return;
    const { HEIGHT: height, ROOM: room } = PhasePlane;
    const density = window.devicePixelRatio || 1;
    [this.canvas.width, this.canvas.height] = [width * density, height * density];
    const context = this.canvas.getContext("2d");
    context.scale(density, density);
    const curves = [curve, this.#curve(this.kept)].filter(Boolean);
    const ends = (key) => {
      const values = curves.flatMap((c) => Array.from(c[key].values)).filter(Number.isFinite);
      const [low, high] = [Math.min(...values), Math.max(...values)];
      const margin = (high - low || Math.abs(high) || 1) * 0.06;
      return [low - margin, high + margin];
    };
    const [[left, right], [low, high]] = [ends("q"), ends("v")];
    const x = (q) => 1.6 * room + ((q - left) / (right - left)) * (width - 1.8 * room);
    const y = (v) => height - room - ((v - low) / (high - low)) * (height - 1.4 * room);
    const style = getComputedStyle(this.canvas);
    const ink = style.getPropertyValue("--plot-text").trim() || "#333";
    context.strokeStyle = style.getPropertyValue("--plot-grid").trim() || "#ddd";
    context.strokeRect(x(left), y(high), x(right) - x(left), y(low) - y(high));
    const line = ({ q, v }, colour, dash) => {
      context.beginPath();
      context.setLineDash(dash);
      context.strokeStyle = colour;
      context.lineWidth = 1.6;
      q.values.forEach((value, i) => context.lineTo(x(value), y(v.values[i])));
      context.stroke();
      context.setLineDash([]);
    };
    if (curves[1]) line(curves[1], ink, [2, 3]);
    line(curve, this.palette[0], []);
    this.#dot(context, curve, x, y);
    this.#axes(context, curve, ink, { x, y, left, right, low, high, width, height });
  }

  #dot(context, { q, v, time }, x, y) {
    const [across, up] = [q, v].map(({ values }) => TimePlot.at(time, values, this.time ?? time[0]));
    context.beginPath();
    context.arc(x(across), y(up), 5, 0, 2 * Math.PI);
    context.fillStyle = this.palette[1];
    context.fill();
  }

  #axes(context, { q, v }, ink, { x, y, left, right, low, high, width, height }) {
    const named = ({ label, unit }) => (unit ? `${label.replace(/ \[.*\]$/, "")} [${unit}]` : label);
    context.fillStyle = ink;
    context.font = "12px system-ui, sans-serif";
    const write = (text, across, up, align) => {
      context.textAlign = align;
      context.fillText(text, across, up);
    };
    const short = (value) => PlotNumbers.value(Number(value.toPrecision(3)));
    write(short(left), x(left), height - 18, "left");
    write(short(right), x(right), height - 18, "right");
    write(named(q), (x(left) + x(right)) / 2, height - 4, "center");
    write(short(high), x(left) - 4, y(high) + 10, "right");
    write(short(low), x(left) - 4, y(low), "right");
    context.save();
    context.translate(12, (y(low) + y(high)) / 2);
    context.rotate(-Math.PI / 2);
    write(named(v), 0, 0, "center");
    context.restore();
    this.canvas.setAttribute("aria-label", `Phase plane: ${named(v)} over ${named(q)}`);
  }
}
