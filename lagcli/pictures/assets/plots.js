"use strict";

/*
 * Plots over time, drawn by uPlot: zoom by dragging, values under a cursor that all plots share.
 *
 * Needs uPlot and instants.js. A plot is described by
 *
 *   {title, unit, symbol, log, time: [nt], marks: [n],
 *    series: [{name, label, unit, time: [n], values: [nt], hidden, color, key}]}
 *
 * `title`, `unit`, `symbol`, `label`, `hidden`, `color`, `key` and `marks`, times with a thin line,
 * may be missing; `symbol` is what the upright axis shows where it is not the curves' labels; `log`
 * draws magnitudes on a logarithmic scale; `time` of a curve has its own times, which are the same for
 * all curves that have some: those of another run; `color` is a colour or a custom property, by
 * default one of the palette; `key` is the subject of a curve, see Focus. Lists may be typed arrays;
 * null and NaN are gaps. An underscore in a label begins the subscript of a letter. Nothing in it is
 * read as HTML.
 */

/**
 * The time that plots and animations show together, and the interval that plots show. The time is one of
 * the instants at which all of them have values of the result, once they are known.
 */
class TimeLink {
  constructor(instants = null) {
    this.instants = instants;
    this.time = null;
    this.range = null; // [from, to], or null for everything
    this.free = true; // whether passing over a plot moves the time; a click always does
    this.listeners = { time: [], range: [] };
  }

  /** Call listener(time, source) whenever the time changes. */
  onTime(listener) {
    this.listeners.time.push(listener);
  }

  /** Call listener(range, source) whenever the interval changes. */
  onRange(listener) {
    this.listeners.range.push(listener);
  }

  setTime(wanted, source = null) {
    const time = this.instants ? Instants.nearest(this.instants, wanted) : wanted;
    if (time === this.time) return;
    this.time = time;
    for (const listener of this.listeners.time) listener(time, source);
  }

  setRange(range, source = null) {
    this.range = range;
    for (const listener of this.listeners.range) listener(range, source);
  }
}

/**
 * What all parts of a page emphasize together: the subjects of a term, an arrow or a curve under the
 * pointer or with the focus of the keyboard. A subject is a key, a text.
 */
class Focus {
  static constraint = (name) => `constraint ${name}`;
  static term = (coordinate, number) => `term ${coordinate} ${number}`;

  constructor() {
    this.listeners = [];
    this.keys = [];
    this.pointed = []; // by the pointer
    this.focused = []; // by the keyboard
    this.pinned = null;
  }

  /** Call listener() whenever the subjects change. */
  onChange(listener) {
    this.listeners.push(listener);
  }

  /** Whether a subject is emphasized. */
  has(key) {
    return this.keys.includes(key);
  }

  /** Emphasize subjects until the pointer leaves them; none when it does. */
  point(...keys) {
    this.pointed = keys;
    this.#tell();
  }

  /** Emphasize subjects while their control has the focus of the keyboard; none when it loses it. */
  hold(...keys) {
    this.focused = keys;
    this.#tell();
  }

  /** Emphasize a subject until it is chosen again. */
  pin(key) {
    this.pinned = this.pinned === key ? null : key;
    this.#tell();
  }

  /** Emphasize the arrows of a scene with all else, and all else with them. */
  attach(scene) {
    scene.onPoint = (names) => this.point(...names.map(Focus.constraint));
    this.onChange(() => scene.highlight((name) => this.has(Focus.constraint(name))));
  }

  /** Return a curve with its subject, its constraint's; in a plot of λ, in the constraint's colour. */
  static curve(series, { by_constraint }, colors) {
    const { constraint } = series;
    if (!constraint) return series;
    const key = Focus.constraint(constraint);
    return by_constraint ? { ...series, key, color: colors[constraint] } : { ...series, key };
  }

  #tell() {
    const pinned = this.pinned ? [this.pinned] : [];
    this.keys = [this.pointed, this.focused, pinned].find((keys) => keys.length) ?? [];
    for (const listener of this.listeners) listener();
  }
}

/** How the numbers of plots are written. */
const PlotNumbers = {
  /** Return a value with six digits. */
  value(number) {
    if (number === null || number === undefined || Number.isNaN(number)) return "–";
    const size = Math.abs(number);
    const text =
      size !== 0 && (size < 1e-3 || size >= 1e6)
        ? Number(number.toPrecision(5)).toExponential()
        : String(Number(number.toPrecision(6)));
    return PlotNumbers.typeset(text);
  },

  /** Return the labels of an axis: as few digits as say its ticks exactly. */
  ticks(numbers) {
    const known = numbers.filter((number) => number !== null);
    const largest = Math.max(0, ...known.map(Math.abs));
    const step = known.length > 1 ? Math.abs(known[1] - known[0]) : largest || 1;
    const raised = largest !== 0 && (largest < 1e-3 || largest >= 1e5);
    const write = (n, digits) =>
      raised && n !== 0 ? n.toExponential(digits) : n.toFixed(raised ? 0 : digits);
    const exact = (digits) =>
      known.every((n) => Math.abs(Number(write(n, digits)) - n) < 1e-3 * step);
    let digits = 0;
    while (digits < 12 && !exact(digits)) digits++;
    return numbers.map((n) => (n === null ? null : PlotNumbers.typeset(write(n, digits))));
  },

  /** Return the whole powers of ten within an interval, at most so many of them. */
  powers(low, high, most) {
    const [first, last] = [Math.ceil(Math.log10(low) - 1e-9), Math.floor(Math.log10(high) + 1e-9)];
    const every = Math.max(1, Math.ceil((last - first + 1) / most));
    const found = [];
    for (let n = Math.ceil(first / every) * every; n <= last; n += every) found.push(10 ** n);
    return found;
  },

  /** Return the labels of powers of ten. */
  power(number) {
    return "10" + PlotNumbers.raised(String(Math.round(Math.log10(number))));
  },

  typeset(text) {
    const [mantissa, exponent] = text.replace(/-/g, "−").split("e");
    if (exponent === undefined) return mantissa;
    return `${mantissa}·10${PlotNumbers.raised(exponent.replace("+", "").replace("−", "-"))}`;
  },

  raised(digits) {
    return digits.replace(/./g, (c) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[c] ?? "⁻");
  },
};

/** The names of curves at their right ends; the same as label_ends in lagcli/pictures/style.py. */
class CurveEnds {
  static MOST = 6; // curves
  static WIDEST = 0.16; // of the width of the plot
  static GUTTER = 46; // beside wide plots, with names or without, so that their times line up
  static WIDE = 480; // CSS pixels
  static LEADER = 12; // length of the line from an end to its name
  static HEIGHT = 14; // of a name
  static APART = 5; // least distance of two ends that it tells apart

  /** @param {HTMLElement} element  around the drawing */
  constructor(element) {
    this.element = element;
    this.labels = [];
  }

  /** Return whether names of curves have room beside a plot of a width. */
  static fit(names, width) {
    const few = names.length > 1 && names.length <= CurveEnds.MOST;
    return few && CurveEnds.#widest(names) <= CurveEnds.WIDEST * width;
  }

  /** Return the room to the right of a plot, whose last number of the axis needs some too. */
  static room(names, width) {
    const named = CurveEnds.fit(names, width) ? CurveEnds.#widest(names) + CurveEnds.LEADER + 4 : 17;
    return Math.max(named, width >= CurveEnds.WIDE || named > 17 ? CurveEnds.GUTTER : 0);
  }

  static #widest(names) {
    const letters = (text) => text.replace(/\p{M}/gu, "").length;
    const width = ([base, ...rest]) => letters(base) + 0.75 * letters(rest.join(","));
    return TimePlot.LETTER * Math.max(...names.map((name) => width(name.split("_"))));
  }

  /**
   * Write the names of curves where they end, if each has room next to its own end.
   *
   * @param {uPlot} chart
   * @param {object[]} curves  {name, value, colour, lit}
   */
  draw(chart, curves) {
    for (const label of this.labels) label.remove();
    this.labels = [];
    const density = window.devicePixelRatio || 1;
    const [left, top, height] = [chart.bbox.left + chart.bbox.width, chart.bbox.top, chart.bbox.height].map((x) => x / density);
    const ends = curves.map(({ value }) => chart.valToPos(value, "y"));
    const inside = curves.length > 1 && ends.every((end) => end >= -1 && end <= height + 1);
    const places = inside ? CurveEnds.spread(ends, CurveEnds.HEIGHT, height) : null;
    const sorted = [...ends].sort((a, b) => a - b);
    if (!places || sorted.some((end, i) => i && end - sorted[i - 1] < CurveEnds.APART)) return;
    const { ctx } = chart;
    ctx.save();
    ctx.lineWidth = density;
    for (const [i, { name, colour, lit }] of curves.entries()) {
      ctx.strokeStyle = colour;
      ctx.beginPath();
      ctx.moveTo((left + 1) * density, (top + ends[i]) * density);
      ctx.lineTo((left + CurveEnds.LEADER) * density, (top + places[i]) * density);
      ctx.stroke();
      const label = document.createElement("span");
      label.className = lit ? "plot-end lit" : "plot-end";
      label.ariaHidden = "true"; // the legend says it
      label.style.left = `${left + CurveEnds.LEADER + 2}px`;
      label.style.top = `${top + places[i]}px`;
      label.append(TimePlot.named(name));
      this.labels.push(label);
    }
    ctx.restore();
    this.element.append(...this.labels);
  }

  /** Return places near others, in their order, at least so far apart and within a height; or null. */
  static spread(at, apart, height) {
    const most = height - (at.length - 1) * apart;
    if (most < 0) return null;
    const order = at.map((_, i) => i).sort((a, b) => at[a] - at[b]);
    // without the steps between them, places need only be in order: means of those that are not
    const blocks = [];
    for (const [k, i] of order.entries()) {
      blocks.push([at[i] - apart * k, 1]);
      while (blocks.length > 1 && blocks.at(-2)[0] >= blocks.at(-1)[0]) {
        const [mean, weight] = blocks.pop();
        const [first, more] = blocks.pop();
        blocks.push([(first * more + mean * weight) / (more + weight), more + weight]);
      }
    }
    const level = blocks.flatMap(([mean, weight]) => Array(weight).fill(mean));
    const places = Array(at.length);
    for (const [k, i] of order.entries()) places[i] = Math.max(0, Math.min(most, level[k])) + apart * k;
    return places;
  }
}

/** One plot over time with its title and legend. */
class TimePlot {
  /** Dashes of the first round of colours, of the second, … */
  static DASHES = [[], [7, 3], [2, 3], [9, 3, 2, 3]];
  static STROKE = 1.6;
  static LEAST_SPACE = 16; // between numbers of the upright axis, CSS pixels
  static LABEL = 18; // width of its label
  static LETTER = 6.6; // width of a letter of that
  static ROUNDED = 1e-12; // of the largest value of the plot: less is rounding
  static CONSTANT = 1e-7; // of the size: changes that are errors of the integration
  static NEAR = 12; // CSS pixels between the pointer and a curve that it points at
  static FAINT = 0.25; // opacity of the other curves

  /**
   * @param {HTMLElement} container  is filled
   * @param {object} data            see above
   * @param {object} options
   * @param {TimeLink} options.link
   * @param {string[]} options.palette  colours; black stands for the colour of the text
   * @param {number} options.height     of the drawing, CSS pixels
   * @param {Focus} options.focus       what the page emphasizes
   */
  constructor(
    container,
    data,
    { link = new TimeLink(), palette = ["#0072B2"], height = 220, focus = new Focus() } = {},
  ) {
    this.container = container;
    container.plot = this; // to be found from the page
    this.data = data;
    this.link = link;
    this.held = false; // a mouse button is down on it
    this.palette = palette;
    this.height = height;
    this.focus = focus;
    this.hidden = new Set(data.series.filter((s) => s.hidden).map((s) => s.name));
    this.#build();
    link.onTime((time, source) => source !== this && this.showTime(time));
    link.onRange((range) => this.#showRange(range));
    focus.onChange(() => this.#emphasize());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.recolour());
    this.watcher = new ResizeObserver(() => this.#fit());
    this.watcher.observe(this.container);
  }

  /** Show other values: {time, series: [{values}]} as at the beginning, or with other series. */
  setData(data) {
    const names = (series) => series.map((s) => s.name).join("\n");
    const same = names(data.series) === names(this.data.series);
    this.data = same
      ? {
          ...this.data,
          ...data,
          series: data.series.map((s, i) => ({ ...this.data.series[i], ...s })),
        }
      : { ...this.data, ...data };
    if (same) {
      this.chart.setData(this.#columns(), false);
      this.upright.replaceChildren(this.#quantity(this.chart.height));
      this.#showRange(this.link.range);
    } else {
      this.chart.destroy();
      this.container.replaceChildren();
      this.#build();
    }
    this.showTime(this.link.time);
  }

  /** Take the page's colours again. */
  recolour() {
    for (const [i, button] of this.buttons.entries()) {
      button.style.setProperty("--series", this.#colour(i));
    }
    this.chart.redraw(false);
  }

  /** Draw in a size, CSS pixels: for print. Without one, fill the container again. */
  resize(width = this.container.clientWidth, height = this.height) {
    this.upright.replaceChildren(this.#quantity(height));
    if (width > 0) this.chart.setSize({ width, height });
    this.showTime(this.link.time);
  }

  /** Put the cursor and the legend's values to a time. */
  showTime(time) {
    const { chart } = this;
    const { min, max } = chart.scales.x;
    const seen = time !== null && min !== null && time >= min && time <= max;
    // uPlot takes a cursor that moves under a held button for a drag, and drops the click
    if (!this.held) chart.setCursor({ left: seen ? chart.valToPos(time, "x") : -10, top: 0 }, false);
    const small = this.data.log ? 0 : TimePlot.ROUNDED * this.largest;
    for (const [i, series] of this.data.series.entries()) {
      const { at, value } = this.#read(series, time);
      const shown = PlotNumbers.value(Math.abs(value) < small ? 0 : value);
      this.values[i].textContent = time === null ? "" : at === time || shown === "–" ? shown : `≈ ${shown}`;
    }
  }

  /** Return a curve's value at a time; of another run, its sample that is nearest, with its time. */
  #read({ time: own, values }, time) {
    if (time === null) return { at: null, value: NaN };
    if (!own) return { at: time, value: TimePlot.at(this.data.time, values, time) };
    const at = Instants.nearest(own, time);
    const within = time >= own[0] && time <= own[own.length - 1];
    return { at, value: within ? TimePlot.at(own, values, at) : NaN };
  }

  /** Return a curve at a time: the sample there, of a jump what follows it, or between samples. */
  static at(times, values, time) {
    const low = Instants.last(times, time);
    const high = low + 1;
    if (times[low] >= time || high === times.length) return values[low] ?? NaN;
    const part = (time - times[low]) / (times[high] - times[low]);
    return values[low] + part * (values[high] - values[low]);
  }

  /** Draw the curves of emphasized subjects as usual, and the others faintly. */
  #emphasize() {
    const { series } = this.data;
    const some = series.some((s) => this.focus.has(s.key));
    for (const [i, s] of series.entries()) {
      const lit = this.focus.has(s.key);
      this.chart.series[i + 1].alpha = some && !lit ? TimePlot.FAINT : 1;
      this.buttons[i].classList.toggle("lit", lit);
    }
    if (some || this.emphasized) this.chart.redraw(false);
    this.emphasized = some;
  }

  #build() {
    const { data } = this;
    const caption = document.createElement("figcaption");
    const words = (data.title ?? "").split(/([ ,]+)/);
    caption.append(...words.map((word) => TimePlot.named(word)));
    caption.normalize(); // for translations of whole texts
    caption.hidden = !data.title;
    const drawing = document.createElement("div");
    drawing.className = "plot-drawing";
    this.ends = new CurveEnds(drawing);
    this.upright = document.createElement("span");
    this.upright.className = "plot-upright";
    this.upright.append(this.#quantity(this.height));
    const legend = this.#legend();
    this.container.classList.add("plot");
    const scale = this.#scaleOfFamily();
    this.container.append(caption, drawing, ...(scale ? [scale, this.#folded(legend)] : [legend]));

    const text = () => this.#style("--plot-text", "#333");
    const grid = { stroke: () => this.#style("--plot-grid", "#ddd"), width: 1 };
    const axis = { stroke: text, grid, ticks: grid, font: "12px system-ui, sans-serif" };
    const options = {
      width: Math.max(this.container.clientWidth, 120),
      height: this.height,
      legend: { show: false },
      padding: [null, () => CurveEnds.room(this.#names(), this.container.clientWidth), null, null],
      scales: { x: { time: false }, y: this.#scale() },
      axes: [
        {
          ...axis,
          space: 60,
          size: 42,
          label: "t [s]",
          labelSize: 16,
          labelFont: axis.font,
          values: (chart, splits) => PlotNumbers.ticks(splits),
        },
        {
          ...axis,
          // three numbers on a low plot too
          space: (chart, axis, low, high, height) =>
            Math.max(TimePlot.LEAST_SPACE, Math.min(34, height / 4)),
          size: (chart, labels) => TimePlot.#room(labels) + TimePlot.LABEL,
          ...(data.log
            ? {
                splits: (chart, i, low, high) =>
                  PlotNumbers.powers(low, high, this.#most(chart)),
                values: (chart, splits) => splits.map(PlotNumbers.power),
                filter: (chart, splits) => splits,
              }
            : { values: (chart, splits) => PlotNumbers.ticks(splits) }),
        },
      ],
      series: [{}, ...data.series.map((series, i) => this.#strokes(series, i))],
      cursor: {
        y: false,
        points: data.series.length <= 12 ? { size: 6 } : { show: false },
        drag: { x: true, y: false, setScale: false },
        bind: { dblclick: () => () => this.link.setRange(null, this) },
      },
      hooks: { setSelect: [() => this.#zoom()], drawAxes: [(chart) => this.#mark(chart)], draw: [(chart) => this.#nameEnds(chart)] },
    };
    this.chart = new uPlot(options, this.#columns(), drawing);
    drawing.append(this.upright);
    this.#listen();
    this.#showRange(this.link.range);
    this.showTime(this.link.time);
  }

  /** Draw a thin line at each marked time, none closer than three pixels to the last one. */
  #mark(chart) {
    const { ctx, bbox } = chart;
    const { min, max } = chart.scales.x;
    ctx.save();
    ctx.strokeStyle = this.#style("--plot-mark", "#808080");
    ctx.lineWidth = 0.6 * (window.devicePixelRatio || 1);
    ctx.globalAlpha = 0.6;
    ctx.beginPath();
    let last = -Infinity;
    for (const time of this.data.marks ?? []) {
      if (time < min || time > max) continue;
      const x = chart.valToPos(time, "x", true);
      if (x - last < 3) continue;
      last = x;
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
    }
    ctx.stroke();
    ctx.restore();
  }

  /** Return what curves are called at their ends; nothing of magnitudes and of kept runs. */
  #names() {
    const own = this.data.log ? [] : this.data.series.filter((s) => !("ghostOf" in s));
    return own.map((s) => s.label ?? s.name);
  }

  #nameEnds(chart) {
    const { data, focus } = this;
    const fits = CurveEnds.fit(this.#names(), this.container.clientWidth);
    const shown = [...data.series.entries()].filter(([, s]) => fits && !("ghostOf" in s) && !this.hidden.has(s.name));
    const curves = shown.map(([i, { label, name, values, key }]) => ({
      name: label ?? name,
      value: TimePlot.at(data.time, values, chart.scales.x.max),
      colour: this.#colour(i),
      lit: focus.has(key),
    }));
    this.ends.draw(chart, curves);
    this.container.classList.toggle("plot-named", this.ends.labels.length === data.series.length);
  }

  /** Return how many numbers the upright axis has room for. */
  #most(chart) {
    const height = chart.bbox.height / (window.devicePixelRatio || 1);
    return Math.max(2, Math.min(6, Math.floor(height / TimePlot.LEAST_SPACE)));
  }

  /** What the upright axis shows: φ, ψ [rad]; of many curves, without their subscripts: x, y [m]. */
  #quantity(height) {
    const unit = this.data.unit ? `[${this.data.unit}]` : "";
    const own = this.data.series.filter((s) => !("ghostOf" in s));
    const names = own.map((s) => s.label ?? s.name);
    const choices = this.data.log
      ? [["magnitude"]]
      : this.data.symbol
        ? [[this.data.symbol]]
        : [names, [...new Set(names.map(TimePlot.#base))], [this.data.title || ""]];
    const length = (texts) => [...texts.join(", "), " ", ...unit].length * TimePlot.LETTER;
    const fits = (texts) => texts.length <= 4 && length(texts) <= height - TimePlot.LEAST_SPACE;
    const fragment = document.createDocumentFragment();
    for (const [i, name] of (choices.find(fits) ?? []).entries())
      fragment.append(i ? ", " : "", TimePlot.named(name));
    const spaced = fragment.textContent && unit ? ` ${unit}` : unit;
    fragment.append(spaced);
    return fragment;
  }

  /** Return a label without its index or subscript, if it is a letter and not a word. */
  static #base(name) {
    const base = name.replace(/\[.*\]$/, "").replace(/([₀-₉,]+|_.*)$/, "");
    return base && TimePlot.#letters(base) <= 2 ? base : name.replace(/\[.*\]$/, "");
  }

  /** Return how many letters a text has, without accents. */
  static #letters(text) {
    return text.replace(/\p{M}/gu, "").length;
  }

  /** A label with its subscript: of letters, not of words. */
  static named(text) {
    const [base, ...rest] = text.split("_");
    const fragment = document.createDocumentFragment();
    if (!rest.length || !base || TimePlot.#letters(base) > 2) {
      fragment.append(text);
      return fragment;
    }
    const sub = document.createElement("sub");
    sub.textContent = rest.join(",").replaceAll(".", ",");
    fragment.append(base, sub);
    return fragment;
  }

  static #room(labels) {
    const longest = Math.max(0, ...(labels ?? []).map((text) => (text ? text.length : 0)));
    return Math.max(58, 24 + 7.6 * longest); // one width for most, so that times line up
  }

  #style(name, otherwise) {
    return getComputedStyle(this.container).getPropertyValue(name).trim() || otherwise;
  }

  #colour(i) {
    const { ghostOf = i, color } = this.data.series[i] ?? {};
    if (color) return color.startsWith("--") ? this.#style(color, "#808080") : color;
    const colour = this.palette[ghostOf % this.palette.length];
    return /^#0{3,6}$/.test(colour) ? this.#style("--plot-text", colour) : colour;
  }

  /** Return the number of the dashes of a curve: curves of one colour differ by them. */
  #dashed(i) {
    if ("ghostOf" in this.data.series[i]) return 2;
    const colour = this.#colour(i);
    const before = this.data.series.slice(0, i).filter((_, k) => this.#colour(k) === colour);
    return before.length % TimePlot.DASHES.length;
  }

  #strokes(series, i) {
    return {
      label: series.label ?? series.name,
      stroke: () => this.#colour(i),
      width: "ghostOf" in series ? TimePlot.STROKE / 2 : TimePlot.STROKE,
      dash: TimePlot.DASHES[this.#dashed(i)],
      show: !this.hidden.has(series.name),
      pxAlign: 0,
      points: { show: this.data.time.length === 1 },
    };
  }

  #scale() {
    if (this.data.log) return { distr: 3 };
    // a constant shows its own value, not the errors of its last digits
    const range = (chart, low, high) => {
      if (low === null) return [0, 1];
      const size = Math.max(Math.abs(low), Math.abs(high));
      if (high - low <= TimePlot.CONSTANT * size) return [low - (size || 1) / 10, high + (size || 1) / 10];
      const margin = (high - low) * 0.06;
      return [low - margin, high + margin];
    };
    return { range };
  }

  #columns() {
    const columns = this.data.series.map(({ values }) => Array.from(values, TimePlot.#drawable));
    this.largest = columns.flat().reduce((m, x) => Math.max(m, Math.abs(x ?? 0)), 0);
    if (this.data.log) {
      let least = Infinity;
      for (const column of columns) {
        for (const value of column) {
          if (value !== null && value !== 0) least = Math.min(least, Math.abs(value));
        }
      }
      const floor = Number.isFinite(least) ? 10 ** Math.floor(Math.log10(least)) : 1e-16;
      const shown = (value) => (value === null ? null : Math.max(Math.abs(value), floor));
      return this.#aligned(columns.map((column) => column.map(shown)));
    }
    return this.#aligned(columns);
  }

  /** Return columns beside their times; where curves have times of their own, at those of both. */
  #aligned(columns) {
    const { time, series } = this.data;
    const other = series.find((s) => s.time)?.time;
    if (!other) return [time, ...columns];
    const rows = [time, other].flatMap((times, k) => Array.from(times, (t, i) => ({ t, own: k === 1, i })));
    rows.sort((a, b) => a.t - b.t);
    const values = (column, k) => rows.map(({ own, i }) => (own === Boolean(series[k].time) ? column[i] : undefined));
    return [rows.map(({ t }) => t), ...columns.map(values)];
  }

  static #drawable(value) {
    return Number.isFinite(value) ? value : null;
  }

  #legend() {
    const list = document.createElement("ul");
    list.className = "plot-legend";
    this.buttons = [];
    this.values = [];
    for (const [i, series] of this.data.series.entries()) {
      const button = document.createElement("button");
      button.type = "button";
      button.dataset.series = series.name;
      button.title = "Show or hide this curve";
      button.setAttribute("aria-pressed", String(!this.hidden.has(series.name)));
      button.style.setProperty("--series", this.#colour(i));
      const swatch = document.createElement("span");
      swatch.className = `plot-swatch plot-dash-${this.#dashed(i)}`;
      const label = document.createElement("span");
      label.className = "plot-label";
      label.append(TimePlot.named(series.label ?? series.name));
      const value = document.createElement("span");
      value.className = "plot-value";
      button.append(swatch, label, " ", value); // the space is spoken
      button.addEventListener("click", () => this.#toggle(i));
      if (series.key) {
        button.addEventListener("pointerenter", () => this.focus.point(series.key));
        button.addEventListener("pointerleave", () => this.focus.point());
        button.addEventListener("focus", () => this.focus.hold(series.key));
        button.addEventListener("blur", () => this.focus.hold());
      }
      const item = document.createElement("li");
      item.append(button);
      list.append(item);
      this.buttons.push(button);
      this.values.push(value);
    }
    return list;
  }

  /** Return the colours of a family from its first to its last member; null for few curves, or others. */
  #scaleOfFamily() {
    const { series } = this.data;
    const own = series.filter((s) => !("ghostOf" in s));
    const graded = own.every(({ name, color }) => color && name.includes("["));
    if (own.length <= CurveEnds.MOST || !graded) return null;
    const scale = document.createElement("div");
    scale.className = "plot-family";
    scale.style.setProperty("--colours", own.map(({ color }) => color).join(", "));
    const bar = document.createElement("span");
    bar.className = "plot-colours";
    const end = ({ label, name }) => {
      const text = document.createElement("span");
      text.append(TimePlot.named(label ?? name));
      return text;
    };
    scale.append(end(own[0]), bar, end(own.at(-1)));
    return scale;
  }

  /** Return a long legend behind a summary. */
  #folded(legend) {
    const details = document.createElement("details");
    details.className = "plot-values";
    const summary = document.createElement("summary");
    summary.textContent = "Values of the curves";
    details.append(summary, legend);
    return details;
  }

  #toggle(i) {
    const { name } = this.data.series[i];
    const hide = !this.hidden.has(name);
    if (hide) this.hidden.add(name);
    else this.hidden.delete(name);
    this.buttons[i].setAttribute("aria-pressed", String(!hide));
    this.chart.setSeries(i + 1, { show: !hide });
  }

  #listen() {
    const { chart, link } = this;
    const { over } = chart;
    const names = this.data.series.map((s) => s.label ?? s.name).join(", ");
    over.tabIndex = 0;
    over.setAttribute("role", "application");
    over.setAttribute(
      "aria-label",
      `${this.data.title || `Plot of ${names}`}: arrow keys move the time, plus and minus zoom,` +
        " 0 shows all",
    );
    const at = (event) => {
      const left = event.clientX - over.getBoundingClientRect().left;
      const { min, max } = chart.scales.x;
      return Math.max(min, Math.min(max, chart.posToVal(left, "x")));
    };
    const go = (time) => {
      link.setTime(time, this);
      this.showTime(link.time);
    };
    let pressed = null;
    over.addEventListener("mousedown", (event) => {
      pressed = event.clientX;
      this.held = true;
      document.addEventListener("mouseup", () => (this.held = false), { once: true });
    });
    over.addEventListener("mousemove", (event) => {
      if (link.free && !event.buttons) go(at(event));
      this.focus.point(...this.#keysNear(event));
    });
    over.addEventListener("mouseleave", () => this.focus.point());
    over.addEventListener("click", (event) => {
      if (pressed === null || Math.abs(event.clientX - pressed) < 4) go(at(event));
    });
    // a finger moves the time; up and down it scrolls the page
    over.addEventListener("pointermove", (event) => {
      if (event.pointerType === "touch") go(at(event));
    });
    // when the mouse leaves, uPlot takes its cursor away: put it back to the time
    over.addEventListener("mouseleave", () => setTimeout(() => this.showTime(link.time)));
    over.addEventListener("keydown", (event) => this.#key(event, go));
  }

  #key(event, go) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const { chart, link } = this;
    const { time } = this.data;
    const { min, max } = chart.scales.x;
    const now = link.time ?? min;
    const step = event.shiftKey ? (max - min) / 10 : (max - min) / 100;
    const clamped = (t) => Math.max(time[0], Math.min(time[time.length - 1], t));
    const goOn = (t) => go(Instants.step(link.instants ?? time, now, clamped(t)));
    const scaled = (factor) => {
      const centre = Math.max(min, Math.min(max, now));
      const [from, to] = [centre - (centre - min) * factor, centre + (max - centre) * factor];
      link.setRange([clamped(from), clamped(to)], this);
    };
    const actions = {
      ArrowLeft: () => goOn(now - step),
      ArrowRight: () => goOn(now + step),
      Home: () => go(time[0]),
      End: () => go(time[time.length - 1]),
      "+": () => scaled(0.5),
      "=": () => scaled(0.5),
      "-": () => scaled(2),
      0: () => link.setRange(null, this),
      Escape: () => link.setRange(null, this),
    };
    const action = actions[event.key];
    if (!action || time.length < 2) return;
    action();
    event.preventDefault();
    event.stopPropagation();
  }

  /** Return the key of the curve that a pointer is near to, if there is one. */
  #keysNear({ clientX, clientY }) {
    const { chart, data } = this;
    const { left, top } = chart.over.getBoundingClientRect();
    const time = chart.posToVal(clientX - left, "x");
    let [nearest, least] = [undefined, TimePlot.NEAR];
    for (const { name, time: own, values, key } of data.series) {
      if (this.hidden.has(name)) continue;
      const away = Math.abs(chart.valToPos(TimePlot.at(own ?? data.time, values, time), "y") - (clientY - top));
      if (away < least) [nearest, least] = [key, away];
    }
    return nearest === undefined ? [] : [nearest];
  }

  #zoom() {
    const { chart } = this;
    const { left, width } = chart.select;
    if (width < 4) return;
    const range = [chart.posToVal(left, "x"), chart.posToVal(left + width, "x")];
    chart.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    this.link.setRange(range, this);
  }

  #showRange(range) {
    const { time } = this.data;
    if (!time.length) return;
    let [min, max] = range ?? [time[0], time[time.length - 1]];
    if (!(max > min)) [min, max] = [min - 0.5, min + 0.5];
    this.chart.setScale("x", { min, max });
    this.container.classList.toggle("plot-zoomed", range !== null);
    queueMicrotask(() => this.showTime(this.link.time));
  }

  #fit() {
    const width = this.container.clientWidth;
    if (width > 0 && Math.abs(width - this.chart.width) > 1) this.resize();
  }
}
