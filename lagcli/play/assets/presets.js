"use strict";

/*
 * Presets: values that the author of the model has named.
 *
 *   const presets = new Presets(element, (state, event) => …);
 *   presets.build(list);   // [{name, description, state, locked}], as lagcli/play/presets.py returns them
 *   presets.mark(state);   // which of them the page has: a state of Controls
 *   presets.find(name);    // the preset of a name; undefined for none
 *
 * The description of the preset that the page has is below the names.
 */

class Presets {
  /**
   * @param {HTMLElement} element  is filled
   * @param {function(Array, Event)} chosen  with the state of a preset
   */
  constructor(element, chosen) {
    [this.element, this.chosen, this.list] = [element, chosen, []];
  }

  /** Show these presets. */
  build(list) {
    this.list = list;
    this.element.hidden = !list.length;
    this.buttons = list.map(({ name, description, state, locked }) => {
      const button = Row.text("button", "preset", name);
      button.type = "button";
      button.setAttribute("aria-pressed", "false");
      button.title = locked.length ? `This page cannot set ${locked.join(", ")}` : description;
      button.disabled = locked.length > 0;
      button.addEventListener("click", (event) => this.chosen(state, event));
      return button;
    });
    this.about = Row.text("p", "preset-description", "");
    const actions = Row.text("div", "actions", "");
    actions.append(...this.buttons);
    this.element.replaceChildren(Row.text("h2", "", "Presets"), actions, this.about);
  }

  /** Mark the preset whose values the page has. */
  mark(state) {
    const current = this.list.findIndex((preset) => Presets.#same(preset.state, state));
    this.buttons.forEach((button, i) => button.setAttribute("aria-pressed", String(i === current)));
    this.about.textContent = this.list[current]?.description ?? "";
    this.about.hidden = !this.about.textContent;
  }

  find(name) {
    return this.list.find((preset) => preset.name === name && !preset.locked.length);
  }

  /** Whether two states have the same values; their order does not matter. */
  static #same(one, other) {
    const values = new Map(other);
    return (
      one.length === values.size &&
      one.every(([name, { text, free }]) => {
        const value = values.get(name);
        return value !== undefined && value.free === free && Number(value.text) === Number(text);
      })
    );
  }
}
