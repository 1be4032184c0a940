"use strict";

/*
 * The page: asks for the run of the values that the controls show, and draws it.
 *
 *   const page = new Page(connection, scenarios);
 *
 * The connection is a Socket to the program, or a Simulator in an exported page: send(request), `open`,
 * onMessage(take), onClose(closed); `refines`, whether runs while a slider moves are less accurate. The
 * store of scenarios has read() and write(list).
 *
 * Each change is sent at once. The program leaves out requests that newer ones have overtaken; an
 * answer to an older request than the last one drawn is not drawn.
 */

class Page {
  static PATIENCE = 300; // ms before the page says that it waits

  constructor(connection, store) {
    [this.connection, this.store] = [connection, store];
    const found = (id) => document.getElementById(id);
    this.elements = Object.fromEntries(
      ["name", "description", "status", "notice", "pictures", "command"].map((id) => [id, found(id)]),
    );
    this.number = 0;
    this.drawn = 0;
    this.asked = new Map(); // number → when the reader moved
    this.delays = []; // ms from a move to its drawing, the last hundred
    this.answer = null;
    this.controls = new Controls(found("controls"), (event) => this.ask(event));
    found("controls").addEventListener("change", (event) => {
      if (connection.refines && event.target.type === "range") this.ask(event);
    });
    this.presets = new Presets(found("presets"), (state, event) => this.controls.goTo(state, event));
    found("reset").addEventListener("click", (event) => {
      this.equations.restore();
      this.controls.reset(event);
    });
    found("save").addEventListener("click", () => this.#send({ save: true }));
    found("copy").addEventListener("click", () => this.#copy());
    const keep = found("keep");
    keep.addEventListener("click", () => {
      const kept = keep.getAttribute("aria-pressed") !== "true";
      keep.setAttribute("aria-pressed", String(kept));
      keep.textContent = kept ? "Remove the kept run" : "Keep this run for comparison";
      this.pictures.keep(kept);
    });
    addEventListener("beforeprint", () => this.#print(true));
    addEventListener("afterprint", () => this.#print(false));
    connection.onClose((text) => this.#close(text));
    connection.onMessage((answer) => this.#take(answer));
  }

  /** Called when the page has its controls: for what another page adds. */
  begun() {}

  /** Ask for the run of the values as they are. */
  ask(event = null) {
    this.#send({ coarse: event?.type === "input" && event.target.type === "range" });
    this.scenarios?.mark();
    this.presets.mark(this.controls.state());
    if (event) this.asked.set(this.number, event.timeStamp);
    this.waiting ??= setTimeout(() => this.#say("computing …"), Page.PATIENCE);
  }

  #send(more) {
    if (!this.connection.open) return;
    const plots = this.pictures.groups();
    const { members } = this;
    const live = this.equations.request();
    const message = { number: ++this.number, ...this.controls.changes(), plots, members, ...live, ...more };
    this.connection.send(message);
  }

  #take(answer) {
    if ("palette" in answer) this.#begin(answer);
    else if ("file" in answer) download(`${this.#fileName()}_changed.yaml`, answer.file);
    else if ("files" in answer) for (const [name, text] of Object.entries(answer.files)) download(name, text);
    else if (answer.number > this.drawn) this.#draw(answer);
  }

  #begin(hello) {
    const { elements } = this;
    document.title = hello.page ?? `${hello.name} – lagcli play`;
    elements.name.textContent = hello.name;
    this.slug = hello.slug;
    elements.description.textContent = hello.description;
    const [player, plots, more] = ["player", "plots", "more"].map((id) => document.getElementById(id));
    this.#arrange(more);
    this.pictures = new Pictures(player, plots, more, hello, {
      wanted: () => this.ask(),
      drag: {
        ask: (drag) => this.#send({ drag }),
        begun: () => (this.before = this.controls.state()),
        moved: (answer) => this.#drag(answer),
        released: (event) => this.ask(event),
        cancelled: () => this.controls.goTo(this.before),
      },
    });
    this.pictures.draggable = hello.draggable;
    const { link, focus } = this.pictures;
    this.equations = new LiveEquations(document.getElementById("equations"), {
      ...{ link, focus },
      wanted: (event) => this.ask(event),
      now: () => this.pictures.now,
    });
    this.#build(hello);
    this.events = new Happened(document.getElementById("events"), (t) => this.pictures.goTo(t));
    this.scenarios = new Scenarios(document.getElementById("scenarios"), {
      now: () => ({
        state: this.controls.state(),
        command: this.elements.command.textContent,
        changes: this.controls.changes(),
      }),
      chosen: (state, event) => this.controls.goTo(state, event),
      say: (text) => this.#say(text, true),
      slug: () => this.#fileName(),
      store: this.store,
    });
    this.begun();
    this.ask();
  }

  /** On a narrow screen, the other plots are below the values, also for the keyboard. */
  #arrange(more) {
    const narrow = matchMedia(Controls.NARROW);
    const place = () => (narrow.matches ? document.querySelector("main") : this.elements.pictures).append(more);
    narrow.addEventListener("change", place);
    place();
  }

  /** Show the command line, which breaks between its words. */
  #showCommand(text) {
    const words = text.match(/(?:'[^']*'|[^\s'])+/g) ?? [];
    const whole = words.join(" ") === text ? words : [text];
    const parts = whole.flatMap((word, i) => [i ? " " : "", Row.text("span", "", word)]);
    this.elements.command.replaceChildren(...parts);
  }

  /** Show a configuration in which a body is held. */
  #drag(answer) {
    this.controls.place(answer.initial);
    this.#showCommand(answer.command);
    this.pictures.pose(answer.scene);
  }

  /** Show the controls of a model with these numbers of members. */
  #build({ members, controls, presets, equations, colors, arms }) {
    this.equations.build(equations, colors);
    Object.assign(this.pictures, { colors, units: arms });
    this.members = members;
    this.controls.build(controls);
    this.presets.build(presets);
    this.presets.mark(this.controls.state());
  }

  #draw(answer) {
    this.drawn = answer.number;
    if (answer.number === this.number) {
      clearTimeout(this.waiting);
      this.waiting = undefined;
    }
    const { dragging } = this.pictures;
    if ("gesture" in answer) {
      dragging.answered(answer);
      return;
    }
    if (dragging?.active && !("error" in answer)) return; // its release asks for another run
    this.#showCommand(answer.command);
    if (answer.number === this.number) this.scenarios.mark(answer.command);
    this.elements.pictures.classList.toggle("stale", "error" in answer);
    if ("error" in answer) {
      dragging?.drop();
      this.#notice(answer.error, "error");
      this.#say("");
      return;
    }
    this.answer = answer;
    if ("controls" in answer) this.#build(answer);
    if ("draggable" in answer) this.pictures.draggable = answer.draggable;
    this.controls.follow(answer);
    this.pictures.draw(answer, this.equations.cut);
    this.equations.draw(answer.balance);
    this.events.show(answer.events);
    this.#notice(answer.message, "warning");
    // plots draw in microtasks of their own, which come before this one
    queueMicrotask(() => this.#measure(answer));
  }

  #measure({ number, counts, method }) {
    const began = this.asked.get(number);
    for (const older of this.asked.keys()) if (older <= number) this.asked.delete(older);
    const said = [method, `${counts.steps} steps`];
    if (began !== undefined) {
      const delay = performance.now() - began;
      this.delays = [...this.delays.slice(-99), delay];
      said.push(`drawn after ${delay.toFixed(0)} ms`);
    }
    this.#say(said.join(", "));
  }

  /** Say how things are; aloud only what the reader has asked for. */
  #say(text, aloud = false) {
    this.elements.status.ariaLive = aloud ? "polite" : "off";
    this.elements.status.textContent = text;
  }

  #notice(text, kind) {
    const { notice } = this.elements;
    notice.hidden = !text;
    notice.className = kind;
    // errors show lines of the model, in which every character has its place
    const names = kind === "warning" ? (text ?? "").split("`") : [text];
    const parts = names.map((part, i) => (i % 2 ? Row.text("code", "", part) : part));
    notice.replaceChildren(...parts);
  }

  /** The name of the model, as the beginning of the name of a file. */
  #fileName() {
    return this.slug.replace(/[^\p{L}\p{N}._-]+/gu, "_");
  }

  async #copy() {
    const { command } = this.elements;
    try {
      await navigator.clipboard.writeText(command.textContent);
      this.#say("copied", true);
    } catch {
      getSelection().selectAllChildren(command);
      this.#say("the browser does not allow copying: the command is selected", true);
    }
  }

  /** On paper: light, with the equations and all values; then as before. */
  #print(printing) {
    if (printing === Boolean(this.folded) || !this.pictures) return;
    this.folded ??= [...document.querySelectorAll("#equations, #events, #controls > details")].filter(({ open }) => !open);
    for (const part of this.folded) part.open = printing;
    if (!printing) this.folded = undefined;
    document.documentElement.classList.toggle("printing", printing);
    this.pictures.print(printing);
  }

  #close(text) {
    this.elements.pictures.classList.add("stale");
    this.#notice(text, "error");
    document.getElementById("values").inert = true;
  }
}

/** Let the reader save a text as a file. */
function download(name, text, type = "application/yaml") {
  const address = URL.createObjectURL(new Blob([text], { type }));
  Object.assign(document.createElement("a"), { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 1000);
}
