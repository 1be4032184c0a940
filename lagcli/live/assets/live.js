"use strict";

/*
 * The exported page: that of `lagcli play` with a Simulator, and a link that holds its state.
 *
 * The fragment of the address is that of a query: `#m=2&l=0.3&phi'=~1`, values in the units of the
 * controls, t_end among them; `~` before a value makes it a guess, `!` a fixed one. `preset=heavy` stands
 * for the values of a preset, which the others replace. The scenarios are in
 * the entry `!scenarios`, which no name can be.
 */

/** The fragment of the page's address. */
class State {
  static SCENARIOS = "!scenarios";
  static PRESET = "preset"; // unless the model has a value of this name

  entries() {
    return [...new URLSearchParams(location.hash.slice(1))];
  }

  /** The scenarios, for Scenarios. */
  read() {
    return new URLSearchParams(location.hash.slice(1)).get(State.SCENARIOS) ?? "";
  }

  write(text) {
    this.scenarios = text;
    this.keep(this.values ?? []);
  }

  /** Put entries, [name, text], in the address. */
  keep(values) {
    this.values = values;
    this.scenarios ??= this.read();
    const every = this.scenarios ? [...values, [State.SCENARIOS, this.scenarios]] : values;
    const plain = (text) => encodeURIComponent(text).replaceAll("%5B", "[").replaceAll("%5D", "]").replaceAll("%2C", ",");
    const fragment = every.map(([name, text]) => `${plain(name)}=${plain(text)}`).join("&");
    try {
      history.replaceState(null, "", `#${fragment}`);
    } catch {
      // a frame without an address of its own
    }
    return fragment;
  }
}

class LivePage extends Page {
  static PATIENCE_OF_ADDRESS = 300; // ms: browsers limit how often an address may change

  constructor(connection, state) {
    super(connection, state);
    this.state = state;
    addEventListener("hashchange", () => this.#restore());
  }

  begun() {
    this.#share();
    this.#restore();
  }

  ask(event = null) {
    super.ask(event);
    clearTimeout(this.keeping);
    this.keeping = setTimeout(() => this.#keep(), LivePage.PATIENCE_OF_ADDRESS);
  }

  /** Take the values of the address. */
  #restore() {
    const [state, unknown] = [new Map(), []];
    const entries = this.state.entries();
    const own = this.controls.list.has(State.PRESET);
    for (const [, name] of entries.filter(([name]) => name === State.PRESET && !own)) {
      const preset = this.presets.find(name);
      if (preset) preset.state.forEach(([name, value]) => state.set(name, value));
      else unknown.push(`${State.PRESET}=${name}`);
    }
    for (const [name, text] of entries) {
      if (name === State.SCENARIOS || (name === State.PRESET && !own)) continue;
      const control = this.controls.list.get(name);
      if (!control || control.follows) unknown.push(name);
      else state.set(name, { text: text.replace(/^[~!]/, ""), free: { "~": true, "!": false }[text[0]] ?? control.free });
    }
    this.unknown.hidden = !unknown.length;
    this.unknown.textContent = unknown.length ? `${say("The link has values that this page cannot set:")} ${unknown.join(", ")}` : "";
    this.controls.goTo([...state], null);
  }

  /** Put the values of the controls in the address, and show the link. */
  #keep() {
    const marked = ({ text, free }, control) => (free === control?.free ? text : `${free ? "~" : "!"}${text}`);
    const values = this.controls.state().map(([name, value]) => [name, marked(value, this.controls.list.get(name))]);
    const fragment = this.state.keep(values);
    const address = location.href.split("#")[0];
    this.link.value = fragment ? `${address}#${fragment}` : address;
    const place = /^https?:/.test(address) ? address : address.split("/").at(-1);
    const title = document.title.replaceAll("&", "&amp;").replaceAll('"', "&quot;").replaceAll("<", "&lt;");
    this.frame.value = `<iframe src="${place}${fragment ? `#${fragment.replaceAll("&", "&amp;")}` : ""}" title="${title}" width="100%" height="720" sandbox="allow-scripts allow-downloads"></iframe>`;
  }

  /** How to pass the page on. */
  #share() {
    this.unknown = Object.assign(document.createElement("p"), { className: "warning", id: "unknown", role: "alert", hidden: true });
    this.elements.notice.after(this.unknown);
    const share = Object.assign(document.createElement("details"), { id: "share" });
    share.append(Row.text("summary", "", say("Share")));
    [this.link, this.frame] = [
      ["input", "Link to this page with these values"],
      ["textarea", "HTML that shows this page in another one"],
    ].map(([tag, text]) => {
      const label = Row.text("label", "", say(text));
      const field = Object.assign(document.createElement(tag), { readOnly: true, spellcheck: false });
      if (tag === "textarea") field.rows = 4;
      field.addEventListener("focus", () => field.select());
      label.append(field);
      share.append(label);
      return field;
    });
    document.getElementById("scenarios").before(share);
  }
}

const content = JSON.parse(document.getElementById("content").textContent);
useWords(JSON.parse(document.getElementById("words").textContent));
document.getElementById("save").textContent = say("Download the model");
new Translation(words).observe(document.body);
const page = new LivePage(new Simulator(content), new State());
