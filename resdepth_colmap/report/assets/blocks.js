// Binary data lies as base64 in script elements and is decoded when it is looked at.
// PNG files are decoded here, not by a canvas: some browsers add noise to canvases.

function blockBytes(id) {
  const text = atob(byId(id).textContent);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return bytes;
}

function blockImageUrl(id) {
  return `data:image/jpeg;base64,${byId(id).textContent}`;
}

// 8 bits a channel, grey or RGB, not interlaced: what our own encoder writes.
async function decodePng(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const parts = [];
  let width = 0, height = 0, channels = 1;
  for (let at = 8; at + 8 <= bytes.length; at += 12 + view.getUint32(at)) {
    const kind = String.fromCharCode(...bytes.subarray(at + 4, at + 8));
    if (kind === "IHDR") {
      width = view.getUint32(at + 8);
      height = view.getUint32(at + 12);
      channels = bytes[at + 17] === 2 ? 3 : 1;
    } else if (kind === "IDAT") {
      parts.push(bytes.subarray(at + 8, at + 8 + view.getUint32(at)));
    }
  }
  const stream = new Blob(parts).stream().pipeThrough(new DecompressionStream("deflate"));
  const raw = new Uint8Array(await new Response(stream).arrayBuffer());
  return { width, height, channels, values: unfiltered(raw, width * channels, height, channels) };
}

function unfiltered(raw, stride, height, step) {
  const values = new Uint8Array(stride * height);
  for (let row = 0; row < height; row++) {
    const filter = raw[row * (stride + 1)];
    const from = row * (stride + 1) + 1;
    const to = row * stride;
    for (let i = 0; i < stride; i++) {
      const left = i >= step ? values[to + i - step] : 0;
      const above = row ? values[to + i - stride] : 0;
      const corner = row && i >= step ? values[to + i - stride - step] : 0;
      values[to + i] = raw[from + i] + predicted(filter, left, above, corner);
    }
  }
  return values;
}

function predicted(filter, left, above, corner) {
  if (filter === 0) return 0;
  if (filter === 1) return left;
  if (filter === 2) return above;
  if (filter === 3) return (left + above) >> 1;
  const toLeft = Math.abs(above - corner);
  const toAbove = Math.abs(left - corner);
  const toCorner = Math.abs(left + above - 2 * corner);
  if (toLeft <= toAbove && toLeft <= toCorner) return left;
  return toAbove <= toCorner ? above : corner;
}

// The high bytes lie above the low ones.
function joinedPlanes(png) {
  const half = png.values.length / 2;
  const joined = new Uint16Array(half);
  for (let i = 0; i < half; i++) joined[i] = (png.values[i] << 8) | png.values[half + i];
  return joined;
}
