// SPDX-License-Identifier: MIT
// The report's page: one time cursor and one zoom for ribbons, curves and map. What a recording says
// is only ever set as text.
"use strict";
(async function () {
  const $ = (id) => document.getElementById(id);
  const node = (name, className, text) => {
    const made = document.createElement(name);
    if (className) made.className = className;
    if (text !== undefined) made.textContent = text;
    return made;
  };
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const fail = (words) => { $("now").textContent = words; };

  // --- data --------------------------------------------------------------------------------------

  let data, bytes;
  try {
    data = JSON.parse($("data").textContent);
    const letters = atob($("columns").textContent), packed = new Uint8Array(letters.length);
    for (let k = 0; k < letters.length; k++) packed[k] = letters.charCodeAt(k);
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
    bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  } catch (error) {
    fail("The curves of this page are missing or damaged: was it saved whole? " +
         "What stands above is complete; write the page again for the rest.");
    return;
  }
  const TYPES = { u1: Uint8Array, u2: Uint16Array, u4: Uint32Array, f4: Float32Array };
  const exact = (c) => new TYPES[c.kind](bytes.buffer, c.at, c.count);
  const unpack = (c) => { // see packed.py
    const out = new Array(c.count);
    for (let k = 0, whole = 0; k < c.count; k++) {
      whole = (whole + (bytes[c.at + k] << 8) + bytes[c.at + c.count + k]) & 0xffff;
      out[k] = whole ? c.low + (whole - 1) * c.step : null;
    }
    return out;
  };
  const t = Array.from(exact(data.t), (ms) => ms / 1e3);
  const health = exact(data.health), reasons = exact(data.reasons), status = exact(data.status);
  const count = t.length, end = t[count - 1] || 1;
  const view = { from: 0, to: end, at: 0 };
  const nearest = (time) => {
    let low = 0, high = count - 1;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (t[middle] < time) low = middle + 1; else high = middle;
    }
    return low && time - t[low - 1] < t[low] - time ? low - 1 : low;
  };

  // --- what a frame says -------------------------------------------------------------------------

  const COLOURS = ["--good", "--degraded", "--lost", "--diverged", "--waits"];
  const harmless = new Set(data.words.harmless);
  const said = (k) => {
    const out = [];
    for (let bit = 0; bit < 32; bit++) {
      if (reasons[k] >>> bit & 1 && !harmless.has(bit)) out.push(data.words.reasons[bit] || `reason ${bit}`);
    }
    return out;
  };
  const tell = () => {
    const k = view.at, refused = status[k] - 128;
    const words = refused ? `frame refused: ${data.words.status[refused] || refused}` : said(k).join(", ");
    $("now").replaceChildren(
      node("b", "", `${t[k].toFixed(2)} s `),
      document.createTextNode(`frame ${k + 1} of ${count}: ${data.words.health[health[k]]}${words ? ": " + words : ""}`));
  };

  // --- curves ------------------------------------------------------------------------------------

  const charts = [];
  let busy = false;
  const font = "12px system-ui, sans-serif";
  const short = (x) => x == null ? "" : Math.abs(x) >= 1e5 || (x && Math.abs(x) < 1e-4) ? x.toExponential(1)
    : String(Number(x.toPrecision(4)));
  const axis = (unit, more) => Object.assign({
    stroke: () => css("--soft"), font, labelFont: font, grid: { stroke: () => css("--line"), width: 1 },
    ticks: { stroke: () => css("--line"), width: 1 },
  }, more);

  const whole = (u, ticks) => ticks.map((x) => x > 0 && Math.abs(Math.log10(x) % 1) < 1e-6 ? x : null);
  const decades = { size: 62, filter: whole, values: (u, ticks) => ticks.map((x) => x == null ? "" : short(x)),
    grid: { stroke: () => css("--line"), width: 1, filter: whole }, ticks: { stroke: () => css("--line"), width: 1, filter: whole } };

  const levels = (chart) => (u) => { // lines at fixed values
    u.ctx.save();
    u.ctx.strokeStyle = css("--level");
    u.ctx.setLineDash([6, 5]);
    for (const level of chart.levels || []) {
      const y = u.valToPos(level, "y", true);
      if (y < u.bbox.top || y > u.bbox.top + u.bbox.height) continue;
      u.ctx.beginPath();
      u.ctx.moveTo(u.bbox.left, y);
      u.ctx.lineTo(u.bbox.left + u.bbox.width, y);
      u.ctx.stroke();
    }
    u.ctx.restore();
  };

  const beyond = (chart, columns, note) => (u) => { // how far a band goes, where the axis does not
    if (!chart.band) return;
    const { min, max } = u.scales.y, [from, to] = [nearest(view.from), nearest(view.to)];
    let low = min, high = max;
    for (const b of chart.band) for (let k = from; k <= to; k++) {
      const x = columns[b][k];
      if (x != null) { if (x < low) low = x; if (x > high) high = x; }
    }
    const reach = [low < min ? short(low) : "", high > max ? short(high) : ""].filter((x) => x);
    note.textContent = reach.length ? ` the band leaves the axis: to ${reach.join(" and ")}` : "";
  };

  function range(chart, columns) { // of the main lines: a band may leave the picture
    const main = columns.filter((_, k) => !(chart.band || []).includes(k));
    return (u, low, high) => {
      low = Infinity; high = -Infinity;
      const [from, to] = [nearest(view.from), nearest(view.to)];
      for (const column of main) for (let k = from; k <= to; k++) {
        const x = column[k];
        if (x != null && (!chart.log || x > 0)) { if (x < low) low = x; if (x > high) high = x; }
      }
      if (low > high) return chart.log ? [0.1, 10] : [-1, 1];
      if (chart.log) return [10 ** Math.floor(Math.log10(low)), 10 ** Math.ceil(Math.log10(high) + 1e-9)];
      if (chart.levels) { low = Math.min(low, ...chart.levels); high = Math.max(high, ...chart.levels); }
      if (chart.band) { // it is seen where the error fills a sixth of the picture and more
        const reach = 6 * Math.max(Math.abs(low), Math.abs(high));
        for (const b of chart.band) for (let k = from; k <= to; k++) {
          const x = columns[b][k];
          if (x != null && Math.abs(x) <= reach) { if (x < low) low = x; if (x > high) high = x; }
        }
      }
      const room = (high - low) * 0.06 || Math.abs(high) * 0.1 || 1;
      return [low - room, high + room];
    };
  }

  // A chart is unpacked and drawn when it comes near the screen; before, its place is kept free.
  const places = new Map();
  const near = new IntersectionObserver((seen) => {
    for (const { isIntersecting, target } of seen) if (isIntersecting) draw(target);
  }, { rootMargin: "300px" });
  function place(chart) {
    const made = node("section", "chart");
    made.append(node("h3", "", chart.title + (chart.unit ? ` (${chart.unit})` : "")));
    if (chart.about) made.append(node("p", "soft", chart.about));
    $("charts").append(made);
    if (chart.empty) {
      made.append(node("p", "empty", chart.empty));
      return;
    }
    made.append(node("div", "free"));
    places.set(made, chart);
    near.observe(made);
  }
  function draw(made) {
    const chart = places.get(made);
    if (!chart) return;
    places.delete(made);
    near.unobserve(made);
    made.lastChild.remove();
    const title = made.firstChild.textContent, note = node("span", "soft");
    made.firstChild.append(note);
    const columns = chart.lines.map(unpack);
    const measured = (k) => chart.lines.findIndex(({ name }) => chart.lines[k].name === `${name} true`);
    const hue = (k) => measured(k) < 0 ? k : measured(k); // the truth has the colour of what is measured, dashed
    const series = chart.lines.map((line, k) => {
      const inBand = (chart.band || []).includes(k);
      return {
        label: line.name, width: inBand ? 1 : 1.5, spanGaps: false, points: { show: count < 60 },
        stroke: () => css(inBand ? "--l3" : `--l${hue(line.like ?? k) % 4}`), // that of another log as its like
        dash: line.like != null ? [6, 3] : measured(k) >= 0 || k > 3 ? [5, 4] : undefined, value: (u, x) => short(x),
      };
    });
    const u = new uPlot({
      width: made.clientWidth, height: 170, legend: { live: true }, padding: [8, 8, 0, 0],
      cursor: { sync: { key: "time", setSeries: false }, drag: { x: true, y: false }, y: false, points: { size: 6 } },
      scales: { x: { time: false }, y: { distr: chart.log ? 3 : 1, range: range(chart, columns) } },
      axes: [axis("s", { size: 30 }), axis("", chart.log ? decades : { size: 62, values: (v, ticks) => ticks.map(short) })],
      series: [{ label: "s", value: (v, x) => x == null ? "" : x.toFixed(2) }, ...series],
      bands: chart.band ? [{ series: [chart.band[1] + 1, chart.band[0] + 1], fill: () => css("--band") }] : [],
      hooks: {
        draw: [levels(chart), beyond(chart, columns, note)],
        setScale: [(v, key) => { if (key === "x" && !busy) zoom(v.scales.x.min, v.scales.x.max); }],
        setCursor: [(v) => { if (!busy && v.cursor.idx != null && v.cursor.event) go(v.cursor.idx); }],
      },
    }, [t, ...columns], made);
    u.root.setAttribute("role", "img");
    u.root.setAttribute("aria-label", `${title}. ${chart.about}`);
    u.over.addEventListener("dblclick", () => zoom(0, end));
    charts.push(u);
    busy = true;
    u.setScale("x", { min: view.from, max: view.to });
    setTimeout(() => { busy = false; go(view.at); }); // uPlot commits its scales in a microtask
  }
  const drawAll = () => { for (const made of [...places.keys()]) draw(made); };

  // --- ribbons -----------------------------------------------------------------------------------

  const ribbons = [];
  function ribbon(label, colour, holds) {
    const row = node("div", "row"), canvas = node("canvas", "ribbon");
    row.append(node("span", "", label), canvas);
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${label}, over time`);
    canvas.addEventListener("pointerdown", (e) => go(nearest(timeAt(canvas, e))));
    $("ribbons").append(row);
    ribbons.push({ canvas, colour, holds });
  }
  const plot = () => { // where curves have their time axis, css px from the left
    const u = charts[0], ratio = window.devicePixelRatio || 1;
    return u ? { left: u.bbox.left / ratio, width: u.bbox.width / ratio } : { left: 0, width: 300 };
  };
  const timeAt = (canvas, e) => {
    const { left, width } = plot();
    const share = (e.clientX - canvas.getBoundingClientRect().left - left) / width;
    return view.from + Math.max(0, Math.min(1, share)) * (view.to - view.from);
  };
  function size(canvas) {
    const ratio = window.devicePixelRatio || 1, box = canvas.getBoundingClientRect();
    canvas.width = Math.round(box.width * ratio);
    canvas.height = Math.round(box.height * ratio);
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    return { pen, width: box.width, height: box.height };
  }
  // What does not follow the cursor is painted once, and copied as long as its key holds.
  let style = 0; // counts changes of dark and light
  function still(holder, canvas, key, paint) {
    const { pen, width, height } = size(canvas);
    const whole = [key, width, height, canvas.width, style].join();
    if (holder.key !== whole) {
      holder.key = whole;
      holder.copy = holder.copy || document.createElement("canvas");
      [holder.copy.width, holder.copy.height] = [canvas.width, canvas.height];
      const there = holder.copy.getContext("2d");
      there.setTransform(pen.getTransform());
      paint(there, width, height);
    }
    pen.save();
    pen.resetTransform();
    pen.drawImage(holder.copy, 0, 0);
    pen.restore();
    return { pen, width, height };
  }
  function paintRibbon(row) {
    const { left, width } = plot();
    const x = (time) => left + (time - view.from) / (view.to - view.from) * width;
    const key = [view.from, view.to, left, width].join();
    const { pen, height } = still(row, row.canvas, key, (there, _, high) => spans(there, row, x, high));
    pen.fillStyle = css("--ink");
    pen.fillRect(x(t[view.at]) - 0.75, 0, 1.5, height);
  }
  function spans(pen, { colour, holds }, x, height) {
    const { left, width } = plot();
    pen.fillStyle = css("--panel");
    pen.fillRect(left, 0, width, height);
    const first = Math.max(nearest(view.from) - 1, 0), last = Math.min(nearest(view.to) + 1, count - 1);
    pen.save();
    pen.beginPath();
    pen.rect(left, 0, width, height);
    pen.clip();
    for (let k = first; k <= last; k++) {
      if (!holds(k)) continue;
      let next = k + 1;
      while (next <= last && holds(next) && colour(next) === colour(k)) next++;
      const until = next < count ? Math.min(t[next], t[next - 1] + 1) : t[count - 1];
      pen.fillStyle = css(colour(k));
      pen.fillRect(x(t[k]), 0, Math.max(x(until) - x(t[k]), 2), height); // one frame is seen, too
      k = next - 1;
    }
    pen.restore();
  }
  function makeRibbons() {
    const there = data.health_beside && exact(data.health_beside);
    const shown = (h) => health.includes(h) || there && there.includes(h);
    const names = [...data.words.health.entries()].filter(([h]) => shown(h)).map(([h, name]) => [COLOURS[h], name]);
    if (status.some((s) => s !== 128)) names.push(["--refused", "frame refused"]);
    for (const [colour, name] of names) {
      const item = node("span"), box = node("i");
      box.style.background = `var(${colour})`;
      item.append(box, document.createTextNode(name));
      $("key").append(item);
    }
    ribbon("health", (k) => status[k] === 128 ? COLOURS[health[k]] : "--refused", () => true);
    if (there) ribbon("health, beside", (k) => COLOURS[there[k]], (k) => there[k] < COLOURS.length);
    let seen = 0;
    for (const bits of reasons) seen |= bits;
    for (let bit = 0; bit < 32; bit++) {
      if (seen >>> bit & 1 && !harmless.has(bit)) {
        ribbon(data.words.reasons[bit] || `reason ${bit}`, () => "--l1", (k) => reasons[k] >>> bit & 1);
      }
    }
  }

  const lower = (column, value) => { // the first that is not less
    let low = 0, high = column.length;
    while (low < high) { const m = (low + high) >> 1; if (column[m] < value) low = m + 1; else high = m; }
    return low;
  };
  const map = pelorusMap({
    data, exact, unpack, lower, $, node, css, still, font, time: () => t[view.at],
    go: (seconds) => go(nearest(seconds), true), later: () => later(),
  });

  // --- one cursor, one zoom ----------------------------------------------------------------------

  let waiting = false;
  function later() { // once a picture of the screen
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; ribbons.forEach(paintRibbon); map.paint(); tell(); mark(); });
  }
  function go(k, show) {
    view.at = Math.max(0, Math.min(count - 1, k));
    if (show && (t[view.at] < view.from || t[view.at] > view.to)) {
      const half = (view.to - view.from) / 2;
      zoom(t[view.at] - half, t[view.at] + half);
    }
    busy = true;
    for (const u of charts) {
      const left = u.valToPos(t[view.at], "x");
      if (Math.abs((u.cursor.left ?? -10) - left) > 0.5) u.setCursor({ left, top: 10 }, false);
    }
    busy = false;
    later();
  }
  function zoom(from, to) {
    const least = Math.min(end, 0.2);
    if (to - from < least) { const middle = (from + to) / 2; from = middle - least / 2; to = middle + least / 2; }
    if (from < 0) { to -= from; from = 0; }
    if (to > end) { from = Math.max(0, from - (to - end)); to = end; }
    if (from === view.from && to === view.to && charts.every((u) => u.scales.x.min === from)) return;
    view.from = from;
    view.to = to;
    busy = true;
    for (const u of charts) u.setScale("x", { min: from, max: to });
    setTimeout(() => { busy = false; go(view.at); }); // uPlot commits its scales in a microtask
    later();
  }
  const scale = (by) => {
    const half = (view.to - view.from) / 2 * by, middle = t[view.at];
    zoom(middle - half, middle + half);
  };
  const events = [...document.querySelectorAll("button.event")];
  function event(k) {
    if (!events.length) return;
    const { from, to } = events[k].dataset, [a, b] = [Number(from), Number(to)];
    const room = Math.max((b - a) * 0.3, 2);
    zoom(a - room, b + room);
    go(nearest(a));
  }
  const next = (by) => {
    const begins = events.map((e) => Number(e.dataset.from));
    const now = t[view.at];
    const found = by > 0 ? begins.findIndex((x) => x > now + 0.05) : begins.findLastIndex((x) => x < now - 0.05);
    if (found >= 0) event(found);
  };
  const theme = () => {
    const root = document.documentElement;
    const dark = root.classList.contains("dark") ||
      (!root.classList.contains("light") && matchMedia("(prefers-color-scheme: dark)").matches);
    root.classList.remove("dark", "light");
    root.classList.add(dark ? "light" : "dark");
    repaint();
  };
  function repaint() { style++; for (const u of charts) u.redraw(false, true); later(); }
  const KEYS = {
    ArrowLeft: (e) => go(view.at - (e.shiftKey ? 10 : 1), true),
    ArrowRight: (e) => go(view.at + (e.shiftKey ? 10 : 1), true),
    Home: () => go(0, true), End: () => go(count - 1, true),
    "+": () => scale(0.5), "=": () => scale(0.5), "-": () => scale(2), 0: () => zoom(0, end),
    n: () => next(1), p: () => next(-1), d: theme,
  };
  document.addEventListener("keydown", (e) => {
    if (e.target.matches("input, textarea, select") || e.ctrlKey || e.metaKey || e.altKey) return;
    const act = KEYS[e.key];
    if (act) { e.preventDefault(); act(e); }
  });
  $("in").addEventListener("click", () => scale(0.5));
  $("out").addEventListener("click", () => scale(2));
  $("all").addEventListener("click", () => zoom(0, end));
  $("back").addEventListener("click", () => go(view.at - 1, true));
  $("on").addEventListener("click", () => go(view.at + 1, true));
  $("previous").addEventListener("click", () => next(-1));
  $("next").addEventListener("click", () => next(1));
  $("theme").addEventListener("click", theme);
  $("previous").hidden = $("next").hidden = !events.length;
  events.forEach((button, k) => button.addEventListener("click", () => event(k)));

  const moments = [...document.querySelectorAll("button.moment")];
  moments.forEach((button) => button.addEventListener("click", () => go(nearest(Number(button.dataset.at)), true)));
  let marked;
  function mark() { // the latest picture that is not after the cursor
    const now = t[view.at] + 1e-3;
    const last = moments.filter((button) => Number(button.dataset.at) <= now).at(-1);
    for (const button of moments) button.classList.toggle("now", button === last);
    if (last && last !== marked) last.parentElement.scrollTo({ left: last.offsetLeft - last.parentElement.offsetLeft - 4 });
    marked = last;
  }

  makeRibbons();
  data.charts.forEach(place);
  if (places.size) draw(places.keys().next().value); // by whose axis the ribbons stand
  addEventListener("beforeprint", drawAll);
  map.start();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
  new ResizeObserver(() => {
    for (const u of charts) {
      const width = u.root.parentElement.clientWidth;
      if (width && width !== u.width) u.setSize({ width, height: 170 });
    }
    later();
  }).observe($("charts"));
  if (events.length) event(0); else go(0);
  document.documentElement.dataset.ready = "yes";
  window.pelorus = { view, go, zoom, count, t, drawAll, map: map.state }; // for tests, and for the console
})();
