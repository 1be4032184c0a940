"use strict";

/*
 * Pictures of the run: the animation and the plots, which share their time.
 *
 *   const pictures = new Pictures(stage, plots, more, hello, calls);
 *   pictures.draggable = ["A", "B"];  // points that the initial values move
 *   pictures.groups();      // the groups of curves that are wanted
 *   pictures.draw(answer);
 *   pictures.pose(scene);   // while a body is held, the start alone
 */

class Pictures {
  static USUAL = ["multipliers", "coordinates", "energies"]; // the first below the mechanism
  static HIGH = 190; // of a plot, CSS pixels
  static LOW = 150; // of one of several panels
  static PAPER = 680; // width between the margins, CSS pixels
  static INSTEAD = "velocities"; // where a model has no constraints

  /**
   * @param {HTMLElement} stage  of the player
   * @param {HTMLElement} plots  of the first plot
   * @param {HTMLElement} more  of the others
   * @param {object} hello  name, palette and groups of the model
   * @param {object} calls
   * @param {function} calls.wanted  called when other curves are wanted
   * @param {object} calls.drag  see Dragging
   */
  constructor(stage, plots, more, { name, palette, groups }, { wanted, drag }) {
    [this.stage, this.name, this.palette, this.drag] = [stage, name, palette, drag];
    this.link = new TimeLink();
    this.focus = new Focus();
    this.colors = {}; // of constraints
    this.units = {}; // of lever arms, by constraint
    this.arms = new LeverArms(document.getElementById("arms"), this.link);
    this.player = null;
    const usual = Pictures.USUAL.map((group) => (group in groups ? group : Pictures.INSTEAD));
    this.slots = usual.map((group, i) => this.#slot(i ? more : plots, group, groups, wanted));
    this.phase = new PhasePlane(more, this.link, palette, wanted);
    // passing over a plot moves the time, unless it runs
    Object.defineProperty(this.link, "free", { get: () => !this.player?.playing });
    this.link.onTime((time, source) => {
      if (!this.player || source === this.player) return;
      this.player.setTime(time);
      this.player.pause();
    });
  }

  /** The time that is shown, s. */
  get now() {
    return this.player?.time ?? this.link.time ?? 0;
  }

  /** Take the colours and sizes of paper: the first plot has the width of two others; or those of the window again. */
  print(printing) {
    for (const [i, { plots }] of this.slots.entries())
      for (const plot of plots) {
        plot.recolour();
        if (printing) plot.resize(i ? Pictures.PAPER / 2 - 10 : Pictures.PAPER, plot.height);
        else plot.resize();
      }
  }

  groups() {
    return [...new Set([...this.slots.map(({ select }) => select.value), ...this.phase.groups()])];
  }

  /** Show the first sample that is not before a time, and stop there. */
  goTo(time) {
    this.link.setTime(this.link.instants ? Instants.after(this.link.instants, time) : time, this);
  }

  /** Keep the run that is shown, behind the next ones; or take a kept one away. */
  keep(kept) {
    this.kept = kept ? this.shown : null;
    this.player?.stage.setGhost(this.kept?.scene ?? null);
    this.draw(this.shown, true);
  }

  /** Return a plot with the curves of the run that was kept. */
  #compared(group, data) {
    const before = this.kept?.plots[group];
    if (!before || this.kept === this.shown) return data;
    const alike = before.time.length === data.time.length && before.time.every((t, i) => t === data.time[i]);
    const time = alike ? undefined : before.time;
    const ghosts = data.series.flatMap((series, i) => {
      const same = before.series.find(({ name }) => name === series.name);
      if (!same) return [];
      const [name, label] = [`${series.name} (kept)`, `${series.label} (kept)`];
      return [{ ...series, name, label, time, values: same.values, ghostOf: i }];
    });
    return { ...data, series: [...data.series, ...ghosts] };
  }

  /** Return the times of the samples of a run. */
  static #instants({ scene, plots }) {
    return scene?.time ?? Object.values(plots)[0]?.time ?? null;
  }

  /** Draw a run; what flies off after a cut leaves the view of the whole mechanism. */
  draw(answer, cut = false) {
    const { scene, plots, speed } = answer;
    this.shown = answer;
    if (scene) {
      scene.colors = this.colors;
      const { bounds, reach } = scene;
      if (cut && this.seen) Object.assign(scene, this.seen);
      else this.seen = { bounds, reach };
    }
    this.link.instants = Pictures.#instants(answer);
    this.stage.hidden = scene === null;
    if (scene && this.player) this.player.setScene(scene);
    else if (scene) {
      const onTime = (time) => this.link.setTime(time, this.player);
      const options = { label: this.name, onTime, speed, autoplay: true };
      this.player = new Player(this.stage, scene, options);
      this.focus.attach(this.player.stage);
      this.#makeDraggable();
    }
    if (this.dragging) this.dragging.points = this.draggable;
    if (this.held) this.#goOn();
    if (scene && plots.multipliers) this.arms.setData(scene, [plots.multipliers], this.units);
    for (const slot of this.slots) this.#fill(slot, plots[slot.select.value]);
    this.phase.draw(plots, this.kept === answer ? null : this.kept?.plots);
    // of a motion that does not play by itself, the numbers of the start
    if (this.link.time === null && this.link.instants?.length) this.link.setTime(this.link.instants[0], this.player);
  }

  /** Draw the panels of a plot: curves of different units or sizes have their own. */
  #fill(slot, whole) {
    if (!whole) return; // chosen a moment ago: another answer has it
    const compared = this.#compared(slot.select.value, whole);
    const count = 1 + Math.max(0, ...whole.series.map(({ panel }) => panel));
    const height = count > 1 ? Pictures.LOW : Pictures.HIGH;
    const { link, palette, focus } = this;
    const none = whole.series.some(({ unit }) => unit) ? "1" : ""; // of a number beside quantities
    for (let number = 0; number < count; number++) {
      const series = compared.series.filter(({ panel }) => panel === number).map((x) => Focus.curve(x, whole, this.colors));
      const ghosts = series.map((x) => ("ghostOf" in x ? { ...x, ghostOf: series.findIndex(({ name }) => name === compared.series[x.ghostOf].name) } : x));
      const unit = whole.log ? "" : series[0]?.unit || none;
      const data = { ...compared, unit, series: ghosts };
      const plot = slot.plots[number];
      if (plot) plot.setData(data);
      else {
        const figure = document.createElement("figure");
        slot.box.append(figure);
        slot.plots.push(new TimePlot(figure, data, { link, focus, palette, height }));
      }
    }
    for (const [number, plot] of slot.plots.entries()) {
      plot.container.hidden = number >= count;
      if (plot.height !== height) {
        plot.height = height;
        plot.resize();
      }
    }
    const drawn = whole.series.length;
    slot.more.textContent = whole.of > drawn ? `${drawn} of ${whole.of} curves, evenly spaced` : "";
  }

  /** Show the start alone, seen from where the run was, its arrows at the same scale. */
  pose(scene) {
    this.held = true;
    const { bounds, reach, shapes } = this.shown.scene;
    const scales = new Map(
      shapes.filter(({ kind }) => kind === "vector").map((shape) => [shape.name, shape.scale]),
    );
    const scaled = scene.shapes.map((shape) => ({
      ...shape,
      scale: scales.get(shape.name) ?? shape.scale,
    }));
    this.player.setScene({ ...scene, bounds, reach, shapes: scaled });
  }

  /** Play the run of a body that was released, from its start. */
  #goOn() {
    this.held = false;
    this.player.setTime(this.player.start);
    this.link.setTime(this.player.start, this.player);
    if (!matchMedia("(prefers-reduced-motion: reduce)").matches) this.player.play();
  }

  #makeDraggable() {
    const { begun } = this.drag;
    this.dragging = new Dragging(this.player.frame, this.player.stage, {
      ...this.drag,
      begun: () => {
        hint.remove();
        this.player.pause();
        begun();
      },
    });
    const hint = Row.text("p", "drag-hint", "Drag a body to change the initial configuration.");
    if (this.draggable.length) this.player.frame.append(hint);
  }

  /** A plot and the choice of what it shows. */
  #slot(plots, group, groups, wanted) {
    const box = document.createElement("div");
    box.className = "slot";
    const select = document.createElement("select");
    select.setAttribute("aria-label", "Curves of this plot");
    for (const [key, title] of Object.entries(groups)) select.add(new Option(title, key));
    select.value = group;
    select.addEventListener("change", wanted);
    const more = Row.text("span", "slot-more", "");
    box.append(select, more);
    plots.append(box);
    return { select, box, more, plots: [] };
  }
}
