"use strict";

/** Return the value in a frame: JSON with its arrays; see `encode` in lagcli/play/server.py. */
function decodeFrame(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const numbers = new Float64Array(buffer, 4 + length);
  const header = new TextDecoder().decode(new Uint8Array(buffer, 4, length));
  return JSON.parse(header, (key, value) => {
    const place = value?.$array;
    return place ? numbers.subarray(place[0], place[0] + place[1]) : value;
  });
}
