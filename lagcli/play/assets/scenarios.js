"use strict";

/*
 * Scenarios: values of the page under a name, to come back to.
 *
 *   const scenarios = new Scenarios(element, { now, chosen, say, slug, store });
 *   scenarios.mark();         // which of them the page has now
 *   scenarios.mark(command);  // as the program answered
 *
 * They are kept in the page's address, and survive a reload. A file that is downloaded holds them for
 * another page.
 */

class Scenarios {
  /**
   * @param {HTMLElement} element  is filled
   * @param {object} calls
   * @param {function(): {state, command, changes}} calls.now  the values of the page: of the controls, as
   *   the command line of their run, and as that takes them
   * @param {function(Array, Event)} calls.chosen  with the state of a scenario
   * @param {function(string)} calls.say
   * @param {function(): string} calls.slug  the beginning of the name of a file
   * @param {object} calls.store  keeps the list as a text: read() and write(text), "" for none
   */
  constructor(element, calls) {
    this.calls = calls;
    this.list = Scenarios.#parsed(calls.store.read());
    const form = document.createElement("form");
    this.field = Object.assign(document.createElement("input"), {
      type: "text",
      placeholder: "Name for the current values",
      autocomplete: "off",
      maxLength: 80,
    });
    this.field.setAttribute("aria-label", "Name of the scenario");
    form.append(this.field, Object.assign(document.createElement("button"), { textContent: "Save" }));
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#save();
    });
    this.items = document.createElement("ul");
    this.export = Row.text("div", "actions", "");
    this.#addCopy("Copy as command lines", () => this.commands());
    this.#addCopy("Copy as presets", () => this.blocks());
    this.export.append(this.#button("Download", () => this.#download()));
    const files = Object.assign(document.createElement("input"), { type: "file", hidden: true });
    files.accept = "application/json";
    files.ariaLabel = "File of scenarios";
    files.addEventListener("change", () => this.#read(files));
    const open = this.#button("Open a file of scenarios", () => files.click());
    element.append(form, this.items, this.export, open, files);
    this.#show();
  }

  /** Mark the scenario whose values the page has, and take the command line of their run. */
  mark(command = null) {
    const now = JSON.stringify(this.calls.now().changes);
    this.list.forEach((scenario, i) => {
      const same = JSON.stringify(scenario.changes) === now;
      this.items.children[i].firstChild.setAttribute("aria-current", String(same));
      if (same && command !== null && scenario.command !== command) {
        scenario.command = command;
        this.#keep();
      }
    });
  }

  /** Return a command line for each scenario, which writes a file of its name. */
  commands() {
    const files = new Set();
    const lines = this.list.map(({ name, command }) => {
      const slug = name.replace(/[^\p{L}\p{N}._-]+/gu, "_").replace(/^[-.]+/, "") || "run";
      let file = slug;
      for (let i = 2; files.has(file); i++) file = `${slug}_${i}`;
      files.add(file);
      return `# ${name}\n${command.replace(/run\.h5$/, `${file}.h5`)}\n`;
    });
    return lines.join("");
  }

  /** Return the scenarios as presets of a model file; these have no end time. */
  blocks() {
    const block = (key, values) => {
      const lines = Object.entries(values).map(([name, value]) => {
        const written = /^\{guess: (.*)\}$/s.exec(value);
        const text = written ? `{guess: ${Scenarios.#yaml(written[1])}}` : Scenarios.#yaml(value);
        return `      ${Scenarios.#yaml(name)}: ${text}\n`;
      });
      return lines.length ? `    ${key}:\n${lines.join("")}` : "";
    };
    const presets = this.list.map(({ name, changes: { set, set_initial, t_end } }) => {
      const inner = block("parameters", set) + block("initial", set_initial);
      const end = t_end ? `  # simulated until t_end = ${t_end}` : "";
      return `  ${Scenarios.#yaml(name)}:${inner ? "" : " {}"}${end}\n${inner}`;
    });
    return `presets:\n${presets.join("")}`;
  }

  /** Return a text as YAML has it: as it is where it is a number or a name, else in quotes. */
  static #yaml(text) {
    const plain = /^([A-Za-z]\w*'*|[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?)$/.test(text);
    return plain ? text : JSON.stringify(text);
  }

  #save() {
    const name = this.field.value.trim().replace(/\s+/g, " ");
    if (!name) {
      this.field.focus();
      this.calls.say("a scenario needs a name");
      return;
    }
    const { state, command, changes } = this.calls.now();
    const at = this.list.findIndex((scenario) => scenario.name === name);
    this.list.splice(at < 0 ? this.list.length : at, 1, { name, state, command, changes });
    this.field.value = "";
    this.#keep();
    this.#show();
    this.calls.say(`saved as ${name}`);
  }

  #remove(at) {
    this.list.splice(at, 1);
    this.#keep();
    this.#show();
  }

  #keep() {
    this.calls.store.write(this.list.length ? JSON.stringify(this.list) : "");
  }

  #download() {
    download(`${this.calls.slug()}_scenarios.json`, JSON.stringify(this.list, null, 1), "application/json");
  }

  /** Add the scenarios of a file; those of the same name are replaced. */
  async #read(input) {
    const [file] = input.files;
    input.value = ""; // the same one may be opened again
    const found = file ? Scenarios.#parsed(await file.text()) : [];
    const names = new Set(found.map(({ name }) => name));
    this.list = [...this.list.filter(({ name }) => !names.has(name)), ...found];
    this.#keep();
    this.#show();
    this.calls.say(found.length ? `${found.length} opened` : "the file holds no scenarios");
  }

  /** Return the scenarios in a text, those that are well formed. */
  static #parsed(text) {
    const texts = (value) =>
      value && typeof value === "object" && Object.values(value).every((x) => typeof x === "string");
    try {
      const found = JSON.parse(text);
      return found.filter(
        ({ name, state, command, changes }) =>
          texts([name, command, changes.t_end]) &&
          texts(changes.set) &&
          texts(changes.set_initial) &&
          state.every(([key, { text, free }]) => texts([key, text]) && typeof free === "boolean"),
      );
    } catch {
      return [];
    }
  }

  #show() {
    this.items.replaceChildren(
      ...this.list.map(({ name, state }, i) => {
        const item = document.createElement("li");
        const choose = Row.text("button", "scenario-name", name);
        choose.addEventListener("click", (event) => this.calls.chosen(state, event));
        const remove = Row.text("button", "", "✕");
        remove.setAttribute("aria-label", `Remove ${name}`);
        remove.addEventListener("click", () => this.#remove(i));
        for (const button of [choose, remove]) button.type = "button";
        item.append(choose, remove);
        return item;
      }),
    );
    this.export.hidden = !this.list.length;
    this.mark();
  }

  #addCopy(label, text) {
    const copy = async () => {
      try {
        await navigator.clipboard.writeText(text());
        this.calls.say("copied");
      } catch {
        this.calls.say("the browser does not allow copying");
      }
    };
    this.export.append(this.#button(label, copy));
  }

  #button(label, clicked) {
    const button = Object.assign(document.createElement("button"), { type: "button" });
    button.textContent = label;
    button.addEventListener("click", clicked);
    return button;
  }
}
