"use strict";

/*
 * The list of what happened at contacts and events: a click goes to the time of an entry.
 *
 *   const list = new Happened(element, (time) => …);
 *   list.show(answer.events); // null of a model without contacts and events
 */

class Happened {
  constructor(element, go) {
    [this.element, this.go] = [element, go];
    this.body = document.createElement("div");
    element.append(this.body);
  }

  show(events) {
    this.element.hidden = events === null;
    this.body.replaceChildren();
    if (!events) return;
    for (const sentence of events.sentences) this.body.append(Row.text("p", "", `${sentence}.`));
    const list = document.createElement("ol");
    for (const { time, text } of events.entries) {
      const button = Row.text("button", "", `${PlotNumbers.value(time)} s`);
      button.type = "button";
      button.addEventListener("click", () => this.go(time));
      const item = document.createElement("li");
      item.append(button, ` ${text}`);
      list.append(item);
    }
    this.body.append(list);
    if (events.more) this.body.append(Row.text("p", "", `And ${events.more} more.`));
  }
}
