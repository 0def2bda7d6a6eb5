// Draws triangles with a depth buffer, so that neither a GPU nor a library is needed, and a click
// knows what it hit.
//   target: {width, height, pixels (Uint32Array, ABGR), near (Float32Array: 1 / depth; 0: nothing),
//   hit (Int32Array: the first index of the triangle; -1: none)}, which are overwritten.
//   surface: {place (three numbers a vertex), corners (three indices a triangle, anticlockwise as
//   seen from the free side), colours (three bytes a vertex), shade (a byte a vertex, in place of
//   colours; or null)}. Triangles that are seen from behind are not drawn.
//   to: function (x, y, z, out) that writes column, row and 1 / depth of a place to out, and returns
//   false where it is not in front of the eye.
//   background: of the pixels that show nothing.
window.twoviewDrawSurface = function (target, surface, to, background) {
  "use strict";
  const { width, height } = target, { place, corners, colours, shade } = surface;
  const count = place.length / 3, screen = new Float32Array(3 * count), out = [0, 0, 0];
  for (let i = 0; i < count; ++i)
    if (to(place[3 * i], place[3 * i + 1], place[3 * i + 2], out)) screen.set(out, 3 * i);
  const pixels = target.pixels.fill(background), near = target.near.fill(0);
  const hit = target.hit.fill(-1);
  const source = shade || colours, i = shade ? 1 : 3, g = shade ? 0 : 1, u = shade ? 0 : 2;
  for (let t = 0; t < corners.length; t += 3) {
    const a = corners[t], b = corners[t + 1], c = corners[t + 2];
    const za = screen[3 * a + 2], zb = screen[3 * b + 2], zc = screen[3 * c + 2];
    if (za === 0 || zb === 0 || zc === 0) continue;
    const ax = screen[3 * a], ay = screen[3 * a + 1];
    const bx = screen[3 * b] - ax, by = screen[3 * b + 1] - ay;
    const cx = screen[3 * c] - ax, cy = screen[3 * c + 1] - ay;
    const area = bx * cy - by * cx;
    if (area >= 0) continue;  // from behind: rows go down, so anticlockwise is below 0
    const x0 = Math.max(0, Math.ceil(ax + Math.min(0, bx, cx) - 0.5));
    const x1 = Math.min(width - 1, Math.floor(ax + Math.max(0, bx, cx) + 0.5));
    const y0 = Math.max(0, Math.ceil(ay + Math.min(0, by, cy) - 0.5));
    const y1 = Math.min(height - 1, Math.floor(ay + Math.max(0, by, cy) + 0.5));
    const ra = source[i * a], ga = source[i * a + g], ba = source[i * a + u];
    const rb = source[i * b] - ra, gb = source[i * b + g] - ga, bb = source[i * b + u] - ba;
    const rc = source[i * c] - ra, gc = source[i * c + g] - ga, bc = source[i * c + u] - ba;
    for (let y = y0; y <= y1; ++y) {
      const dy = y - ay;
      for (let x = x0; x <= x1; ++x) {
        const dx = x - ax;
        const wb = (dx * cy - dy * cx) / area, wc = (bx * dy - by * dx) / area;
        if (wb < -1e-4 || wc < -1e-4 || wb + wc > 1.0001) continue;
        const z = za + wb * (zb - za) + wc * (zc - za);
        const at = y * width + x;
        if (z <= near[at]) continue;
        near[at] = z;
        hit[at] = t;
        pixels[at] = 0xff000000 | (ba + wb * bb + wc * bc) << 16 |
          (ga + wb * gb + wc * gc) << 8 | (ra + wb * rb + wc * rc);
      }
    }
  }
};
