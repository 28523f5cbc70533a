// @ts-check
/**
 * Receives the pictures, decodes and draws the newest, in a thread of its own: the page waits for no graphics. Each is
 * acknowledged as it arrives, so that the server measures the link and not how busy the browser is.
 */

const HEADER = 20; // bytes, see pictures.py

/** @type {OffscreenCanvas | null} */
let canvas = null;
/** @type {ImageBitmapRenderingContext | null} */
let pen = null;
/** @type {WebSocket | null} */
let socket = null;
/** @type {ArrayBuffer | null} */
let newest = null;
let isDrawing = false;

async function draw() {
  if (isDrawing) return;
  isDrawing = true;
  while (newest) {
    const data = newest;
    newest = null;
    const header = new DataView(data, 0, HEADER);
    const picture = new Blob([new Uint8Array(data, HEADER)], { type: "image/jpeg" });
    const bitmap = await createImageBitmap(picture).catch(() => null); // the next one may be sound
    if (!bitmap || !canvas || !pen) continue;
    if (canvas.width !== bitmap.width || canvas.height !== bitmap.height) {
      [canvas.width, canvas.height] = [bitmap.width, bitmap.height];
    }
    pen.transferFromImageBitmap(bitmap);
    await new Promise((done) => requestAnimationFrame(done));
    postMessage({ sent: header.getFloat64(4, true), age: header.getFloat64(12, true) });
  }
  isDrawing = false;
}

onmessage = (event) => {
  if (event.data.canvas) {
    canvas = event.data.canvas;
    pen = event.data.canvas.getContext("bitmaprenderer");
  }
  socket?.close();
  const made = (socket = new WebSocket(event.data.address));
  made.binaryType = "arraybuffer";
  made.onmessage = ({ data }) => {
    if (made.readyState === WebSocket.OPEN) made.send(String(new DataView(data, 0, HEADER).getUint32(0, true)));
    newest = data;
    draw();
  };
};
