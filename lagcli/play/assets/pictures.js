"use strict";

/*
 * Pictures of the run: the animation and the plots, which share their time.
 *
 *   const pictures = new Pictures(stage, plots, hello, () => ask());
 *   pictures.groups();      // the groups of curves that are wanted
 *   pictures.draw(answer);
 */

class Pictures {
  static USUAL = ["coordinates", "multipliers", "energies"];
  static INSTEAD = "velocities"; // where a model has no constraints

  /**
   * @param {HTMLElement} stage  of the player
   * @param {HTMLElement} plots
   * @param {object} hello  name, palette and groups of the model
   * @param {function} wanted  called when other curves are wanted
   */
  constructor(stage, plots, { name, palette, groups }, wanted) {
    [this.stage, this.name, this.palette] = [stage, name, palette];
    this.link = new TimeLink();
    this.player = null;
    const usual = Pictures.USUAL.map((group) => (group in groups ? group : Pictures.INSTEAD));
    this.slots = usual.map((group) => this.#slot(plots, group, groups, wanted));
    // passing over a plot moves the time, unless it runs
    Object.defineProperty(this.link, "free", { get: () => !this.player?.playing });
    this.link.onTime((time, source) => {
      if (!this.player || source === this.player) return;
      this.player.pause();
      this.player.setTime(time);
    });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      for (const { plot } of this.slots) plot?.recolour();
    });
  }

  groups() {
    return [...new Set(this.slots.map(({ select }) => select.value))];
  }

  /** Draw a run. */
  draw({ scene, plots, speed }) {
    this.stage.hidden = scene === null;
    if (scene && this.player) this.player.setScene(scene);
    else if (scene) {
      const onTime = (time) => this.link.setTime(time, this.player);
      const options = { label: this.name, onTime, speed, autoplay: true };
      this.player = new Player(this.stage, scene, options);
    }
    for (const slot of this.slots) {
      const data = plots[slot.select.value];
      if (!data) continue; // chosen a moment ago: another answer has it
      const { link, palette } = this;
      if (slot.plot) slot.plot.setData(data);
      else slot.plot = new TimePlot(slot.figure, data, { link, palette, height: 190 });
      const some = data.of > data.series.length ? `${data.series.length} of ${data.of} curves` : "";
      slot.more.textContent = [data.unit && `[${data.unit}]`, some].filter(Boolean).join(" ");
    }
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
    const figure = document.createElement("figure");
    box.append(select, more, figure);
    plots.append(box);
    return { select, figure, more, plot: null };
  }
}
