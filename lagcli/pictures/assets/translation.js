"use strict";

/*
 * Translation: the texts that scripts write to the page, in its language, as they appear.
 *
 *   new Translation(words).observe(document.body);
 *
 * `words` are translations by English texts, whole ones; {} stands for what varies in both. Texts of the
 * model are left as they are.
 */

class Translation {
  static ATTRIBUTES = ["aria-label", "title", "placeholder"];
  static OF_MODEL = "[translate='no'], .name, math, script, style, #name, #description, code, textarea, .control-name, .scenario-name, .preset, .preset-description";

  constructor(words) {
    const entries = Object.entries(words);
    this.whole = new Map(entries.filter(([text]) => !text.includes("{}")));
    // longer ones first: they have more of the text
    this.patterns = entries
      .filter(([text]) => text.includes("{}"))
      .sort(([a], [b]) => b.length - a.length)
      .map(([text, translated]) => {
        const parts = text.split("{}").map((part) => part.replace(/[.*+?^$()|[\]\\]/g, "\\$&"));
        return [new RegExp(`^${parts.join("(.+)")}$`, "s"), translated];
      });
  }

  /** Return a text in the page's language. */
  of(text) {
    const known = this.whole.get(text);
    if (known !== undefined) return known;
    for (const [pattern, translated] of this.patterns) {
      const found = pattern.exec(text);
      if (!found) continue;
      const parts = found.slice(1).map((part) => this.whole.get(part) ?? part);
      return translated.replace(/\{\}/g, () => parts.shift());
    }
    return text;
  }

  /** Translate what is in an element, and what comes to it. */
  observe(element) {
    if (!this.whole.size) return;
    this.#all(element);
    new MutationObserver((changes) => {
      for (const { type, target, addedNodes } of changes) {
        if (type === "characterData") this.#text(target);
        else if (type === "attributes") this.#attributes(target);
        else addedNodes.forEach((node) => (node.nodeType === Node.TEXT_NODE ? this.#text(node) : this.#all(node)));
      }
    }).observe(element, {
      ...{ childList: true, subtree: true, characterData: true },
      attributeFilter: Translation.ATTRIBUTES,
    });
  }

  #all(node) {
    if (node.nodeType !== Node.ELEMENT_NODE) return;
    const texts = document.createTreeWalker(node, NodeFilter.SHOW_TEXT);
    while (texts.nextNode()) this.#text(texts.currentNode);
    const list = Translation.ATTRIBUTES.map((name) => `[${name}]`).join();
    for (const each of [node, ...node.querySelectorAll(list)]) this.#attributes(each);
  }

  #text(node) {
    if (!/\p{L}{2}/u.test(node.data) || node.parentElement?.closest(Translation.OF_MODEL)) return;
    const text = node.data.trim();
    const translated = this.of(text);
    if (translated !== text) node.data = node.data.replace(text, () => translated);
  }

  #attributes(element) {
    for (const name of Translation.ATTRIBUTES) {
      const text = element.getAttribute(name);
      const translated = text && this.of(text);
      if (translated && translated !== text) element.setAttribute(name, translated);
    }
  }
}
