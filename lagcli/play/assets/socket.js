"use strict";

/*
 * Socket: the page's connection to the program that serves it.
 *
 * The fragment of the page's address keeps its scenarios: no program but the browser reads it, and it is
 * in a bookmark. The address ends with the program.
 */

class Socket {
  constructor() {
    this.socket = new WebSocket(new URL("socket", location.href.replace(/^http/, "ws")));
    this.socket.binaryType = "arraybuffer";
  }

  get open() {
    return this.socket.readyState === WebSocket.OPEN;
  }

  onMessage(take) {
    this.socket.addEventListener("message", ({ data }) => take(decodeFrame(data)));
  }

  onClose(closed) {
    const text = "The server has stopped. To continue, start it again: lagcli play MODEL";
    this.socket.addEventListener("close", () => closed(text));
  }

  send(request) {
    this.socket.send(JSON.stringify(request));
  }
}

class Fragment {
  read() {
    try {
      return decodeURIComponent(location.hash.slice(1));
    } catch {
      return "";
    }
  }

  write(text) {
    history.replaceState(null, "", `#${encodeURIComponent(text)}`);
  }
}

const page = new Page(new Socket(), new Fragment());
