// SPDX-License-Identifier: MIT
// Way and map in three dimensions, seen from far away: what is parallel stays so, a metre is as long
// everywhere, and the outline of an ellipsoid is exactly the ellipse of its projected covariance.
"use strict";
function pelorusMap({ data, exact, unpack, lower, $, node, css, still, font, time, go, later }) {
  const marks = data.landmarks, ids = exact(marks.id), p = marks.p.map(exact), sigma = exact(marks.sigma);
  const firstSeen = exact(marks.first), lastSeen = exact(marks.last), seen = exact(marks.seen);
  const rejected = {};
  for (const name of ["t", "id", "why", "in_succession", "mean2"]) rejected[name] = exact(marks.rejected[name]);
  const tracks = data.map.tracks.map((track) => ({
    name: track.name, p: track.p.map(unpack), t: exact(track.t),
  }));
  // of three sigma: logarithms of half axes, x y z of their turn
  const shapesOf = (packed) => ({ half: packed.half.map(unpack), turn: packed.turn.map(unpack) });
  const markShapes = shapesOf(marks);
  const way = data.map.shapes && { t: exact(data.map.shapes.t), p: data.map.shapes.p.map(exact), ...shapesOf(data.map.shapes) };
  const axes = data.map.axes, signs = data.map.signs || [1, 1];
  // `yaw` about the way's own vertical, `pitch` 0 from above and 90 from the side
  const map = { yaw: 0, pitch: 0, x: 0, y: 0, scale: 1, chosen: -1, moving: false, rests: 0, rows: null };
  const PENS = { estimate: ["--l0", []], truth: ["--truth", [2, 3]] };
  const OTHERS = [["--l1", [7, 4]], ["--l2", [9, 3, 2, 3]], ["--l3", [3, 3]]]; // as in the curves of all runs
  const runs = tracks.map((track) => track.name).filter((name) => !(name in PENS));
  const penOf = (name) => PENS[name] || OTHERS[runs.indexOf(name) % OTHERS.length];
  const every = (track, most) => Math.max(1, Math.ceil(track.t.length / most));
  const canvas = $("map"), ELLIPSES_MOST = 2000;

  // --- projection ------------------------------------------------------------------------------

  const unit = (axis, sign) => [0, 1, 2].map((k) => (k === axis ? sign : 0));
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const right = unit(axes[0], signs[0]), up = unit(axes[1], signs[1]), out = cross(right, up);
  const sum = (a, s, b, t) => a.map((x, k) => s * x + t * b[k]);
  const pivot = [0, 1, 2].map((axis) => { // the middle of the way stays where it is
    const known = tracks.length ? tracks[0].p[axis].filter((x) => x != null) : [];
    return known.length ? [known.reduce((a, b) => a + b, 0) / known.length] : [0];
  });
  function turn(yaw, pitch) {
    const before = map.rows && flat(pivot, 0);
    map.yaw = yaw;
    map.pitch = Math.max(0, Math.min(90, pitch));
    const [a, b] = [yaw * Math.PI / 180, map.pitch * Math.PI / 180];
    const ahead = sum(right, -Math.sin(a), up, Math.cos(a));
    map.rows = [sum(right, Math.cos(a), up, Math.sin(a)), sum(ahead, Math.cos(b), out, Math.sin(b))];
    const after = flat(pivot, 0);
    if (before) { map.x += after[0] - before[0]; map.y += after[1] - before[1]; }
  }
  const flat = ([x, y, z], k) => {
    const [[a, b, c], [d, e, f]] = map.rows;
    return [a * x[k] + b * y[k] + c * z[k], d * x[k] + e * y[k] + f * z[k]];
  };
  const at = ([a, b]) => [map.width / 2 + (a - map.x) * map.scale, map.height / 2 - (b - map.y) * map.scale];
  turn(0, 0);

  function outline({ half, turn }, k) { // half axes in px, and the angle of the first on the screen
    if (half[0][k] == null || turn[0][k] == null) return null;
    const [x, y, z] = turn.map((column) => column[k]);
    const w = Math.sqrt(Math.max(0, 1 - x * x - y * y - z * z));
    const R = [ // its columns are the axes
      [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
      [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
      [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ];
    let [a, b, c] = [0, 0, 0];
    for (let j = 0; j < 3; j++) {
      const length = 10 ** half[j][k] * map.scale;
      const [u, v] = map.rows.map((row) => length * (row[0] * R[0][j] + row[1] * R[1][j] + row[2] * R[2][j]));
      a += u * u; b += u * v; c += v * v;
    }
    const middle = (a + c) / 2, apart = Math.hypot((a - c) / 2, b);
    return [Math.sqrt(middle + apart), Math.sqrt(Math.max(0, middle - apart)), -0.5 * Math.atan2(2 * b, a - c)];
  }
  function ellipse(pen, [x, y], shape, least) { // whether it is large enough to be drawn
    if (!shape || !(shape[0] > least) || shape[0] > 1e5) return false;
    pen.beginPath();
    pen.ellipse(x, y, shape[0], shape[1], shape[2], 0, 7);
    pen.stroke();
    return true;
  }
  function fit() {
    const box = canvas.getBoundingClientRect(), low = [Infinity, Infinity], high = [-Infinity, -Infinity];
    for (const track of tracks.slice(0, 2)) for (let k = 0; k < track.t.length; k += every(track, 5000)) {
      if (track.p[0][k] == null) continue; // of a filter that diverged
      flat(track.p, k).forEach((x, i) => { if (x < low[i]) low[i] = x; if (x > high[i]) high[i] = x; });
    }
    if (low[0] > high[0]) return;
    const side = Math.max(high[0] - low[0], high[1] - low[1], 1e-3);
    map.scale = 0.8 * Math.min(box.width / Math.max(high[0] - low[0], side * 0.2), box.height / Math.max(high[1] - low[1], side * 0.2));
    [map.x, map.y] = [0, 1].map((i) => (low[i] + high[i]) / 2);
  }

  // --- painting --------------------------------------------------------------------------------

  const on = ([x, y]) => x > 0 && y > 0 && x < map.width && y < map.height;
  function paintStill(pen, width, height) {
    [map.width, map.height] = [width, height];
    pen.font = font;
    pen.fillStyle = pen.strokeStyle = css("--dot");
    let left = map.moving ? 0 : ELLIPSES_MOST; // the first are those seen most often
    const places = ids.map((_, k) => k).filter((k) => on(at(flat(p, k))));
    pen.globalAlpha = 0.6;
    for (const k of places) { const [x, y] = at(flat(p, k)); pen.fillRect(x - 1.5, y - 1.5, 3, 3); }
    pen.globalAlpha = 0.35;
    for (const k of places) if (left && ellipse(pen, at(flat(p, k)), outline(markShapes, k), 3)) left--;
    pen.strokeStyle = css("--l0");
    if (way && !map.moving) for (let k = 0; k < way.t.length; k++) ellipse(pen, at(flat(way.p, k)), outline(way, k), 3);
    pen.globalAlpha = 1;
    [...tracks].sort((a, b) => (a.name === "estimate") - (b.name === "estimate")).forEach((track) => {
      const [colour, dashes] = penOf(track.name);
      pen.strokeStyle = css(colour);
      pen.setLineDash(dashes);
      pen.lineWidth = 1.8;
      pen.beginPath();
      const step = every(track, map.moving ? 2000 : 20000);
      for (let k = 0; k < track.t.length; k += step) {
        if (track.p[0][k] != null) pen.lineTo(...at(flat(track.p, k)));
      }
      pen.stroke();
    });
    pen.setLineDash([]);
    scaleBar(pen, height);
    triad(pen, width, height);
  }
  function paint() {
    const key = [map.x, map.y, map.scale, map.yaw, map.pitch, map.moving].join();
    const { pen } = still(map, canvas, key, paintStill);
    const now = Math.round(time() * 1e3);
    const own = tracks[0];
    if (own) {
      const place = at(flat(own.p, Math.max(lower(own.t, now + 1) - 1, 0)));
      pen.fillStyle = css("--accent");
      pen.strokeStyle = css("--paper");
      pen.lineWidth = 2;
      pen.beginPath();
      pen.arc(...place, 6, 0, 7);
      pen.fill();
      pen.stroke();
      pen.strokeStyle = css("--accent");
      if (way && way.t.length) ellipse(pen, place, outline(way, Math.max(lower(way.t, now + 1) - 1, 0)), 6);
    }
    pen.strokeStyle = css("--lost");
    for (let k = lower(rejected.t, now); k < rejected.t.length && rejected.t[k] === now; k++) {
      const mark = ids.indexOf(rejected.id[k]);
      if (mark < 0) continue;
      const [x, y] = at(flat(p, mark));
      pen.strokeRect(x - 4, y - 4, 8, 8);
    }
    if (map.chosen >= 0) {
      const place = at(flat(p, map.chosen));
      pen.strokeStyle = css("--ink");
      pen.beginPath();
      pen.arc(...place, 8, 0, 7);
      pen.stroke();
      ellipse(pen, place, outline(markShapes, map.chosen), 8);
    }
  }
  function scaleBar(pen, height) {
    const wanted = 90 / map.scale, power = 10 ** Math.floor(Math.log10(wanted));
    const metres = [5, 2, 1].find((n) => n * power <= wanted) * power;
    pen.strokeStyle = css("--ink");
    pen.lineWidth = 2;
    pen.beginPath();
    pen.moveTo(12, height - 14);
    pen.lineTo(12 + metres * map.scale, height - 14);
    pen.stroke();
    label(pen, `${Number(metres.toPrecision(1))} m`, 12, height - 22);
  }
  function label(pen, words, x, y) {
    pen.fillStyle = css("--paper");
    pen.fillRect(x - 4, y - 14, pen.measureText(words).width + 8, 19);
    pen.fillStyle = css("--ink");
    pen.fillText(words, x, y);
  }
  function triad(pen, width, height) { // the world's axes
    const [x, y] = [width - 52, height - 44];
    for (let k = 0; k < 3; k++) {
      const [dx, dy] = [30 * map.rows[0][k], -30 * map.rows[1][k]];
      if (Math.hypot(dx, dy) < 6) continue; // it points at the reader
      pen.beginPath();
      pen.moveTo(x, y);
      pen.lineTo(x + dx, y + dy);
      pen.stroke();
      label(pen, "xyz"[k], x + 1.35 * dx - 4, y + 1.35 * dy + 4);
    }
  }

  // --- a landmark's history --------------------------------------------------------------------

  const s = (ms) => (ms / 1e3).toFixed(2);
  function choose(mark) {
    map.chosen = mark;
    const place = $("landmark");
    if (mark < 0) { place.replaceChildren(node("p", "soft", "No such landmark in this page.")); return; }
    const id = ids[mark];
    const where = p.map((column) => column[mark].toFixed(2)).join(", ");
    const lines = [
      `Landmark ${id} at (${where}) m, sigma ${sigma[mark].toPrecision(2)} m`,
      seen[mark] ? `seen in ${seen[mark]} frames, from ${s(firstSeen[mark])} to ${s(lastSeen[mark])} s` : "never seen in this log",
    ];
    const why = new Map(), times = [];
    for (let k = 0; k < rejected.id.length; k++) {
      if (rejected.id[k] !== id) continue;
      const words = Object.entries(data.words.why).filter(([bit]) => rejected.why[k] & bit).map(([, w]) => w).join(", ");
      why.set(words, (why.get(words) || 0) + 1);
      times.push(k);
    }
    for (const [words, n] of why) lines.push(`${words || "not used"}: ${n} times`);
    if (!times.length) lines.push("never rejected");
    place.replaceChildren(...lines.map((line) => node("p", "", line)));
    for (const k of times.slice(0, 12)) {
      const button = node("button", "", `${s(rejected.t[k])} s`);
      button.title = `${rejected.in_succession[k]} frames in succession; squared distance ${rejected.mean2[k].toPrecision(3)}`;
      button.addEventListener("click", () => go(rejected.t[k] / 1e3));
      place.append(button);
    }
    if (times.length > 12) place.append(node("span", "soft", ` and ${times.length - 12} more`));
    $("id").value = id;
    later();
  }
  function nearestMark(x, y) {
    let best = -1, least = 20;
    for (let k = 0; k < ids.length; k++) {
      const [u, v] = at(flat(p, k)), far = Math.hypot(u - x, v - y);
      if (far < least) { least = far; best = k; }
    }
    return best;
  }

  // --- mouse, finger, keys ---------------------------------------------------------------------

  const closer = (by) => { map.scale *= by; later(); };
  const look = (yaw, pitch) => { turn(yaw, pitch); fit(); later(); };
  const shift = (dx, dy) => { map.x -= dx / map.scale; map.y += dy / map.scale; later(); };
  const KEYS = {
    ArrowLeft: () => turn(map.yaw - 10, map.pitch), ArrowRight: () => turn(map.yaw + 10, map.pitch),
    ArrowUp: () => turn(map.yaw, map.pitch - 10), ArrowDown: () => turn(map.yaw, map.pitch + 10),
    "+": () => closer(1.4), "=": () => closer(1.4), "-": () => closer(1 / 1.4),
  };
  const MOVES = { ArrowLeft: [40, 0], ArrowRight: [-40, 0], ArrowUp: [0, 40], ArrowDown: [0, -40] };
  function key(e) {
    if (e.ctrlKey || e.metaKey || e.altKey) return;
    const move = e.shiftKey && MOVES[e.key];
    if (!move && !KEYS[e.key]) return;
    e.preventDefault();
    e.stopPropagation(); // else the cursor moves as well
    if (move) shift(...move); else KEYS[e.key]();
    map.moving = true;
    clearTimeout(map.rests);
    map.rests = setTimeout(() => { map.moving = false; later(); }, 200);
    later();
  }
  function pointer() {
    let from = null;
    canvas.addEventListener("pointerdown", (e) => {
      from = { x: e.offsetX, y: e.offsetY, moved: false, shifts: e.shiftKey || e.button > 0 };
      canvas.setPointerCapture(e.pointerId);
    });
    canvas.addEventListener("contextmenu", (e) => e.preventDefault());
    canvas.addEventListener("pointermove", (e) => {
      if (!from) return;
      const [dx, dy] = [e.offsetX - from.x, e.offsetY - from.y];
      if (!from.moved && Math.hypot(dx, dy) < 4) return;
      if (from.shifts) shift(dx, dy); else turn(map.yaw - dx * 0.5, map.pitch - dy * 0.5);
      from = { ...from, x: e.offsetX, y: e.offsetY, moved: true };
      map.moving = true;
      later();
    });
    const end = (e) => {
      if (from && !from.moved && e.type === "pointerup") {
        const best = nearestMark(e.offsetX, e.offsetY);
        if (best >= 0) choose(best);
      }
      from = null;
      map.moving = false;
      later();
    };
    canvas.addEventListener("pointerup", end);
    canvas.addEventListener("pointercancel", end);
    canvas.addEventListener("wheel", (e) => { e.preventDefault(); closer(e.deltaY < 0 ? 1.25 : 0.8); }, { passive: false });
  }
  function start() {
    tracks.forEach((track) => {
      const item = node("span"), line = node("i");
      line.style.background = `var(${penOf(track.name)[0]})`;
      item.append(line, document.createTextNode(track.name));
      $("pens").append(item);
    });
    pointer();
    canvas.addEventListener("keydown", key);
    $("closer").addEventListener("click", () => closer(1.4));
    $("farther").addEventListener("click", () => closer(1 / 1.4));
    $("whole").addEventListener("click", () => { fit(); later(); });
    $("above").addEventListener("click", () => look(0, 0));
    $("slant").addEventListener("click", () => look(30, 60));
    $("side").addEventListener("click", () => look(0, 90));
    $("id").addEventListener("change", (e) => choose(ids.indexOf(Number(e.target.value))));
    fit();
  }
  map.outline = (k) => outline(markShapes, k); // for tests
  return { paint, start, state: map };
}
