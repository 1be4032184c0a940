"use strict";

/*
 * Controls: a slider and a field for each value of a model, and what the reader has changed.
 *
 *   const controls = new Controls(element, (event) => ask());
 *   controls.build(list);       // as lagcli/play/controls.py describes them; changes stay
 *   controls.follow(answer);    // values that follow from others, and what the start made of guesses
 *   controls.changes();         // {set, set_initial, t_end}, as the command line takes them
 *   controls.state();           // the same as a list that controls.goTo(list) takes
 */

class Controls {
  static HEADINGS = {
    parameter: "Parameters",
    position: "Initial coordinates",
    velocity: "Initial velocities",
    end: "Simulation",
  };
  static NARROW = "(max-width: 56rem)"; // there the plots are below the controls
  static MANY = 10; // controls of a section that is folded there at first

  /**
   * @param {HTMLElement} element  is filled
   * @param {function(Event)} changed  called after each change by the reader
   */
  constructor(element, changed) {
    this.element = element;
    this.changed = changed;
    this.given = new Map(); // name → {text, free}: what the reader has changed
    this.rows = new Map(); // name → Row
    this.values = {};
    this.start = {};
    this.determined = []; // names of guesses that follow from the constraints
    this.open = new Set(); // keys of sections and families
    this.known = new Set(); // sections that have been shown
    this.logarithmic = new Set(); // names whose sliders are
  }

  /** Show these controls. */
  build(list) {
    this.list = new Map(list.map((control) => [control.name, control]));
    this.rows.clear();
    const sections = Object.entries(Controls.HEADINGS).map(([kind, heading]) =>
      this.#section(kind, heading, list.filter((control) => control.kind === kind)),
    );
    this.element.replaceChildren(...sections.filter((section) => section !== null));
  }

  /** Show the values of a run. */
  follow({ values, start, determined, t_end }) {
    this.values = { ...values, t_end };
    [this.start, this.determined] = [start, determined];
    for (const row of this.rows.values()) this.#show(row);
  }

  /** Return what differs from the program's start, as the command line takes it. */
  changes() {
    const found = { set: {}, set_initial: {}, t_end: "" };
    for (const [name, { text, free }] of this.given) {
      const control = this.list.get(name) ?? this.#like(name);
      const value = Controls.#withUnit(text, control);
      if (control.kind === "end") found.t_end = value;
      else if (control.kind === "parameter") found.set[name] = value;
      else found.set_initial[name] = free ? `{guess: ${value}}` : value;
    }
    return found;
  }

  /** Take initial values from the picture, where a body is held. */
  place(initial) {
    for (const [name, value] of Object.entries(initial)) {
      const free = this.given.get(name)?.free ?? this.list.get(name).free;
      this.given.set(name, { free, text: String(value) });
      this.start[name] = value;
      const row = this.rows.get(name);
      if (row) this.#show(row);
    }
  }

  /** Return the reader's changes: [name, {text, free}] of each. */
  state() {
    return [...this.given].map(([name, { text, free }]) => [name, { text, free }]);
  }

  /** Go to other changes; what the model does not have is left out. */
  goTo(state, event) {
    this.given = new Map(state.filter(([name]) => this.list.get(name) ?? this.#like(name)));
    for (const row of this.rows.values()) this.#restore(row);
    this.changed(event);
  }

  /** Take back all changes. */
  reset(event) {
    this.goTo([], event);
  }

  /** Show the value that the program was started with, until a run says what it has become. */
  #restore(row) {
    delete this.values[row.control.name];
    row.restore();
    this.#show(row);
  }

  /** A member that the model does not have now keeps its value for when it has it again. */
  #like(name) {
    const family = name.replace(/\[.*\]/, "");
    return [...this.list.values()].find((control) => control.family === family);
  }

  static #withUnit(text, { suffix }) {
    const number = /^\s*[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?\s*$/i.test(text);
    return number ? text.trim() + suffix : text.trim();
  }

  #section(kind, heading, list) {
    if (!list.length) return null;
    const folded = list.length > Controls.MANY && matchMedia(Controls.NARROW).matches;
    if (!this.known.has(kind) && !folded) this.open.add(kind);
    this.known.add(kind);
    const section = this.#details(heading, kind);
    for (const [family, members] of Controls.#families(list)) {
      if (family) section.append(this.#family(kind, family, members));
      else section.append(...members.map((control) => this.#row(control)));
    }
    return section;
  }

  /** Return runs of members of one family, and runs of others: [family or "", controls]. */
  static #families(list) {
    const found = [];
    for (const control of list) {
      if (found.at(-1)?.[0] !== control.family) found.push([control.family, []]);
      found.at(-1)[1].push(control);
    }
    return found;
  }

  /** Members are many: their rows are made when they are looked at. */
  #family(kind, family, members) {
    const [first, last] = [members[0], members.at(-1)].map(({ name }) => /\[(.*)\]/.exec(name)[1]);
    const label = members[0].label.replace(/(\[.*\]|[₀-₉]+|_\w+)$/, "") + ` ${first} … ${last}`;
    const details = this.#details(label, `${kind} ${family}`);
    details.className = "family";
    const fill = () => {
      if (details.open && details.children.length === 1)
        details.append(...members.map((control) => this.#row(control)));
    };
    details.addEventListener("toggle", fill);
    fill();
    return details;
  }

  #details(heading, key) {
    const details = document.createElement("details");
    details.append(Row.text("summary", "", heading));
    details.open = this.open.has(key);
    details.addEventListener("toggle", () => this.open[details.open ? "add" : "delete"](key));
    return details;
  }

  #row(control) {
    const { name } = control;
    const row = new Row(control, {
      moved: (event, text) => this.#change(row, { text }, event),
      freed: (event, free) => this.#change(row, { free, text: this.#settled(control, free) }, event),
      reset: (event) => {
        this.given.delete(name);
        this.#restore(row);
        this.changed(event);
      },
      scaled: (logarithmic) => {
        this.logarithmic[logarithmic ? "add" : "delete"](name);
        this.#show(row);
      },
    });
    row.setLogarithmic(this.logarithmic.has(name));
    this.rows.set(name, row);
    this.#show(row);
    return row.element;
  }

  /** Return the value at which a guess is fixed, or from which a fixed value is guessed. */
  #settled({ name, value }, free) {
    const found = free ? this.values[name] : this.start[name];
    return Row.written(found ?? this.values[name] ?? value, 15);
  }

  #change(row, change, event) {
    const { name, free } = row.control;
    this.given.set(name, { free, text: "", ...this.given.get(name), ...change });
    this.#show(row, event.target);
    this.changed(event);
  }

  /** Show a value: the reader's own text, or what the run had. */
  #show(row, source = null) {
    const { name, value, free } = row.control;
    const given = this.given.get(name);
    row.show({
      text: given?.text,
      value: this.values[name] ?? value,
      free: given?.free ?? free,
      start: this.start[name],
      determined: this.determined.includes(name),
      source,
    });
  }
}

/** The row of one value: name, slider, field, and what is to be said of it. */
class Row {
  static count = 0;
  static PLACES = 400; // of a slider
  static DECADES = 2; // to either side of the value, on a logarithmic slider
  static DIGITS = 3; // of a value on it
  static SHOWN = 6; // of a number in a field that is not being edited
  static WHOLE = 15;

  constructor(control, { moved, freed, reset, scaled }) {
    this.control = control;
    const { name, label, unit, description, kind } = control;
    this.element = document.createElement("div");
    this.element.className = "control";
    this.element.dataset.name = name;
    this.element.title = description;
    const id = `control-${Row.count++}`;
    const title = this.#add("label", "control-name", { htmlFor: id });
    title.append(Row.#typeset(label));
    if (unit) title.append(Row.text("span", "control-unit", ` [${unit}]`));
    if (description) title.append(Row.text("span", "control-about", ` ${description}`));
    if (kind === "parameter" && !control.whole && control.value > 0) this.#addScale(scaled);
    this.slider = this.#add("input", "", { type: "range", id });
    this.slider.setAttribute("aria-label", `${name}${description ? `, ${description}` : ""}`);
    this.field = this.#add("input", "control-value", { type: "text", spellcheck: false });
    this.field.inputMode = "decimal";
    this.field.autocomplete = "off";
    this.field.setAttribute("aria-label", `${name}${unit ? ` in ${unit}` : ""}, exact value`);
    this.undo = this.#add("button", "control-reset", { type: "button", textContent: "↺" });
    this.undo.title = `Reset ${name}`;
    this.undo.setAttribute("aria-label", `Reset ${name}`);
    this.note = this.#add("div", "control-note", {});
    if (kind === "position" || kind === "velocity") this.#addFree(freed);
    this.said = Row.text("span", "", "");
    this.note.append(this.said);
    this.restore();
    if (control.follows) this.#fix();
    this.slider.addEventListener("input", (event) => moved(event, this.#value()));
    // a field that is edited has all digits, as the run has
    this.field.addEventListener("focus", () => this.#write(this.whole));
    this.field.addEventListener("blur", () => this.#write(this.short));
    this.field.addEventListener("change", (event) => {
      const text = this.field.value.trim();
      if (text) moved(event, text);
      else reset(event);
    });
    this.undo.addEventListener("click", reset);
  }

  /** A value that only follows from others. */
  #fix() {
    this.element.classList.add("follows");
    for (const input of [this.slider, this.field]) input.disabled = true;
    if (this.scale) this.scale.hidden = true;
  }

  /** Let the slider reach as far as at first. */
  restore() {
    this.#setRange(this.control);
  }

  /** Show a value and what is known of it; `text` is the reader's, undefined where there is none. */
  show({ text, value, free, start, determined, source }) {
    const { unit, text: expression } = this.control;
    const number = text === undefined || text === "" || Number.isNaN(Number(text)) ? value : Number(text);
    if (this.logarithmic && !(number > 0)) this.scale.click(); // a linear one has it
    if (source !== this.slider) {
      this.#reach(number);
      this.slider.value = String(this.logarithmic ? Math.log10(number) : number);
    }
    this.whole = text ?? Row.written(number, Row.WHOLE);
    this.short = Row.#short(this.whole);
    if (source !== this.field && document.activeElement !== this.field) this.field.value = this.short;
    this.slider.setAttribute("aria-valuetext", `${Row.written(number)}${unit ? ` ${unit}` : ""}`);
    this.undo.hidden = text === undefined;
    this.element.classList.toggle("changed", text !== undefined);
    if (this.free) this.free.checked = free;
    const said = [];
    if (expression && text === undefined) said.push(`= ${expression}`);
    // a guess that only selects a solution has a field and no slider
    this.element.classList.toggle("determined", Boolean(free && determined));
    if (this.free && free && start !== undefined) {
      const words = determined ? "follows from the constraints:" : "starts at";
      said.push(`${words} ${Row.written(start, 6)}`);
    }
    this.said.textContent = said.join(", ");
    this.note.hidden = !this.free && !said.length;
  }

  /** Return a number as it is written in a field. */
  static written(number, digits = Row.SHOWN) {
    return String(Number(number.toPrecision(digits)));
  }

  /** Write another text into the field; the next letter replaces it. */
  #write(text) {
    if (this.field.value === text) return;
    this.field.value = text;
    if (document.activeElement === this.field) this.field.select();
  }

  /** Return a text with as many digits as a person reads, if it is a number with more. */
  static #short(text) {
    const digits = text.replace(/e.*$/i, "").replace(/^[-+0.]+|\./g, "");
    const number = Number(text);
    return digits.length > Row.SHOWN && Number.isFinite(number) ? Row.written(number) : text;
  }

  static text(tag, className, textContent) {
    return Object.assign(document.createElement(tag), { className, textContent });
  }

  /** Make the slider logarithmic, or linear as at first. */
  setLogarithmic(logarithmic) {
    this.logarithmic = logarithmic;
    this.scale?.setAttribute("aria-pressed", String(logarithmic));
    this.restore();
  }

  /** Return the value at the slider's place, as text. */
  #value() {
    if (!this.logarithmic) return this.slider.value;
    return Row.written(10 ** Number(this.slider.value), Row.DIGITS);
  }

  #setRange({ low, high, step, value }) {
    if (this.logarithmic) {
      const middle = Math.log10(value);
      [low, high] = [middle - Row.DECADES, middle + Row.DECADES];
      step = (high - low) / Row.PLACES;
    }
    [this.low, this.high] = [low, high];
    Object.assign(this.slider, { min: String(low), max: String(high), step: String(step || "any") });
  }

  /** Widen the slider to a value beyond it: as far around the value as at first. */
  #reach(number) {
    if (this.logarithmic) {
      const place = Math.log10(number);
      if (place < this.low || place > this.high) this.#setRange({ value: number });
      return;
    }
    if (!Number.isFinite(number) || (number >= this.low && number <= this.high)) return;
    const size = 2 * Math.abs(number);
    const low = number < 0 || this.low < 0 ? -size : this.low;
    const high = number > 0 || this.high > 0 ? size : this.high;
    const step = this.control.whole ? 1 : roundLength((high - low) / Row.PLACES);
    const grid = (x, round) => Number((round(x / step) * step).toPrecision(12));
    this.#setRange({ low: grid(low, Math.floor), high: grid(high, Math.ceil), step });
  }

  /** The choice of a logarithmic slider, for a parameter that is positive. */
  #addScale(scaled) {
    const { name } = this.control;
    this.scale = this.#add("button", "control-scale", { type: "button", textContent: "log" });
    this.scale.title = "Logarithmic slider: from a hundredth of the value to a hundred times it";
    this.scale.setAttribute("aria-label", `Logarithmic slider of ${name}`);
    this.scale.addEventListener("click", () => {
      this.setLogarithmic(!this.logarithmic);
      scaled(this.logarithmic);
    });
  }

  #addFree(freed) {
    const label = document.createElement("label");
    label.className = "control-free";
    label.title = "A guess is adjusted to satisfy the constraints; other values are fixed";
    this.free = Object.assign(document.createElement("input"), { type: "checkbox" });
    this.free.setAttribute("aria-label", `guess, ${this.control.name}`);
    this.free.addEventListener("change", (event) => freed(event, this.free.checked));
    label.append(this.free, "guess");
    this.note.append(label);
  }

  #add(tag, className, properties) {
    const child = Object.assign(document.createElement(tag), { className, ...properties });
    this.element.append(child);
    return child;
  }

  /** A name with its subscript, if it is a letter or little more; as in plots. */
  static #typeset(label) {
    const [base, ...rest] = label.split("_");
    const found = document.createDocumentFragment();
    if (!rest.length || [...base].length > 3) found.append(label);
    else found.append(base, Row.text("sub", "", rest.join(",")));
    return found;
  }
}
