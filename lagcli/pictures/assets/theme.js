"use strict";

/* Light and dark of a page: as the system has it, until the button changes it. Paper is light, and nothing is folded. */

class PageTheme {
  constructor() {
    const dark = matchMedia("(prefers-color-scheme: dark)");
    this.root = document.documentElement;
    this.button = document.querySelector("#theme");
    this.onPaint = () => {}; // the colours have changed
    this.onPrint = () => {}; // on paper, or as before again
    this.before = null; // what printing has changed
    this.button.hidden = false;
    this.button.addEventListener("click", () => this.paint(this.root.dataset.theme === "dark" ? "light" : "dark"));
    dark.addEventListener("change", () => this.#follow(dark.matches));
    this.paint(dark.matches ? "dark" : "light");
    addEventListener("beforeprint", () => this.before || this.#print());
    addEventListener("afterprint", () => this.before && this.#restore());
  }

  /** Take a theme: "light" or "dark". */
  paint(name) {
    this.root.dataset.theme = name;
    this.button.textContent = name === "dark" ? "Light" : "Dark";
    this.onPaint();
  }

  #follow(dark) {
    const name = dark ? "dark" : "light";
    if (this.before) this.before.theme = name;
    else this.paint(name);
  }

  #print() {
    const folded = [...document.querySelectorAll("details:not([open])")];
    this.before = { theme: this.root.dataset.theme, folded };
    this.root.classList.add("printing");
    for (const part of folded) part.open = true;
    this.paint("light");
    this.onPrint(true);
  }

  #restore() {
    this.root.classList.remove("printing");
    for (const part of this.before.folded) part.open = false;
    this.paint(this.before.theme);
    this.before = null;
    this.onPrint(false);
  }
}
