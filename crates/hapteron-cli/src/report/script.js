"use strict";
// Stacked plots over one common axis: wheel zooms at the pointer, drag moves, shift and drag selects, double click shows all.
(() => {
  const COLOURS = ["#0072b2", "#d55e00", "#009e73", "#1c2430", "#cc79a7", "#e69f00", "#56b4e9", "#7a5195"];
  const MARGIN = { left: 62, right: 12, top: 8, bottom: 22 };

  const ticks = (low, high, most) => {
    const raw = (high - low) / Math.max(most, 1);
    const power = Math.pow(10, Math.floor(Math.log10(raw)));
    const step = [1, 2, 5, 10].map((f) => f * power).find((s) => s >= raw) || power * 10;
    const list = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) list.push(k * step);
    return { list, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
  };
  const show = (v, digits) => (Object.is(v, -0) ? 0 : v).toFixed(Math.min(digits, 9));
  const compact = (v) => (v === undefined || v === null ? "–" : Math.abs(v) >= 1e5 || (v !== 0 && Math.abs(v) < 1e-3) ? v.toExponential(2) : String(Number(v.toPrecision(4))));

  // Index of the first x not below the value.
  const lower = (xs, value) => {
    let low = 0, high = xs.length;
    while (low < high) { const m = (low + high) >> 1; if (xs[m] < value) low = m + 1; else high = m; }
    return low;
  };

  for (const root of document.querySelectorAll(".plots")) {
    const data = JSON.parse(root.querySelector("script").textContent);
    const all = [Math.min(...data.times.map((x) => x[0])), Math.max(...data.times.map((x) => x[x.length - 1]))];
    if (!(all[1] > all[0])) all[1] = all[0] + 1e-3;
    let view = all.slice(), cursor = null, selecting = null;
    const panels = [];
    const redraw = () => requestAnimationFrame(() => panels.forEach((p) => p.draw()));
    const setView = (a, b) => {
      const width = Math.min(Math.max(b - a, (all[1] - all[0]) * 1e-4), all[1] - all[0]);
      a = Math.min(Math.max(a, all[0]), all[1] - width);
      view = [a, a + width];
      redraw();
    };
    root.querySelector("button").addEventListener("click", () => setView(all[0], all[1]));

    data.plots.forEach((plot, index) => {
      const box = document.createElement("div");
      box.className = "plot";
      const header = document.createElement("header");
      const title = document.createElement("strong");
      title.textContent = plot.title + (plot.unit ? " [" + plot.unit + "]" : "");
      header.append(title);
      const canvas = document.createElement("canvas");
      canvas.setAttribute("role", "img");
      canvas.setAttribute("aria-label", plot.title);
      box.append(header, canvas);
      root.append(box);
      const series = plot.series.map((s, i) => {
        const key = document.createElement("span");
        key.className = "key";
        const swatch = document.createElement("i");
        const colour = COLOURS[(s.colour === null ? i : s.colour) % COLOURS.length];
        swatch.style.background = colour;
        const text = document.createElement("span");
        text.textContent = s.label;
        key.append(swatch, text);
        header.append(key);
        const item = { ...s, xs: data.times[s.time], colour, key, text, on: true };
        key.addEventListener("click", () => { item.on = !item.on; key.classList.toggle("off", !item.on); redraw(); });
        return item;
      });
      const last = index === data.plots.length - 1;
      const panel = { draw };
      panels.push(panel);

      function draw() {
        const ratio = window.devicePixelRatio || 1;
        const width = canvas.clientWidth, height = canvas.clientHeight;
        if (canvas.width !== Math.round(width * ratio)) { canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio); }
        const g = canvas.getContext("2d");
        g.setTransform(ratio, 0, 0, ratio, 0, 0);
        g.clearRect(0, 0, width, height);
        const left = MARGIN.left, right = width - MARGIN.right, top = MARGIN.top, bottom = height - MARGIN.bottom;
        let low = Infinity, high = -Infinity;
        for (const s of series) {
          if (!s.on) continue;
          const from = Math.max(lower(s.xs, view[0]) - 1, 0), to = Math.min(lower(s.xs, view[1]) + 1, s.xs.length);
          for (let i = from; i < to; i++) { const y = s.ys[i]; if (y === null) continue; if (y < low) low = y; if (y > high) high = y; }
        }
        for (const m of plot.marks) { if (high > -Infinity) { low = Math.min(low, m.value); high = Math.max(high, m.value); } }
        if (!(high >= low)) { low = 0; high = 1; }
        if (plot.clip !== null) { low = Math.max(low, -plot.clip); high = Math.min(high, plot.clip); }
        if (low > 0 && low < 0.5 * high) low = 0;
        if (high - low < 1e-9 * Math.max(Math.abs(high), Math.abs(low), 1e-6)) { const e = Math.max(Math.abs(high) * 0.1, 1e-6); low -= e; high += e; }
        const pad = 0.06 * (high - low);
        low = low === 0 ? 0 : low - pad;
        high = high === 0 ? 0 : high + pad;
        const X = (x) => left + (x - view[0]) / (view[1] - view[0]) * (right - left);
        const Y = (y) => bottom - (y - low) / (high - low) * (bottom - top);
        g.font = "12px system-ui, sans-serif";
        g.lineWidth = 1;
        const yt = ticks(low, high, 5), xt = ticks(view[0], view[1], Math.max(3, width / 110));
        g.textBaseline = "middle"; g.textAlign = "right";
        for (const y of yt.list) {
          g.strokeStyle = Math.abs(y) < 1e-12 ? "#b9c1cb" : "#eceff3";
          g.beginPath(); g.moveTo(left, Math.round(Y(y)) + 0.5); g.lineTo(right, Math.round(Y(y)) + 0.5); g.stroke();
          g.fillStyle = "#5b6675"; g.fillText(show(y, yt.digits), left - 6, Y(y));
        }
        g.textBaseline = "top"; g.textAlign = "center";
        for (const x of xt.list) {
          g.strokeStyle = "#eceff3";
          g.beginPath(); g.moveTo(Math.round(X(x)) + 0.5, top); g.lineTo(Math.round(X(x)) + 0.5, bottom); g.stroke();
          g.fillStyle = "#5b6675"; g.fillText(show(x, xt.digits), X(x), bottom + 5);
        }
        if (last) { g.textAlign = "right"; g.textBaseline = "bottom"; g.fillStyle = "#5b6675"; g.fillText(data.axis, right, bottom - 3); }
        g.strokeStyle = "#b9c1cb"; g.strokeRect(left + 0.5, top + 0.5, right - left - 1, bottom - top - 1);
        g.save(); g.beginPath(); g.rect(left, top, right - left, bottom - top); g.clip();
        for (const m of plot.marks) {
          g.strokeStyle = "#b3261e"; g.setLineDash([5, 4]); g.beginPath(); g.moveTo(left, Y(m.value)); g.lineTo(right, Y(m.value)); g.stroke(); g.setLineDash([]);
          const under = Y(m.value) < top + 16;
          g.fillStyle = "#b3261e"; g.textAlign = "left"; g.textBaseline = under ? "top" : "bottom"; g.fillText(m.label, left + 6, Y(m.value) + (under ? 2 : -2));
        }
        for (const s of series) {
          if (!s.on) continue;
          const from = Math.max(lower(s.xs, view[0]) - 1, 0), to = Math.min(lower(s.xs, view[1]) + 1, s.xs.length);
          g.strokeStyle = s.colour; g.lineWidth = 1.4; g.beginPath();
          let pen = false, column = null, least = 0, most = 0;
          const flush = () => { if (column !== null && least !== most) { g.moveTo(column, least); g.lineTo(column, most); } };
          if (to - from > 3 * (right - left)) {
            // More points than pixels: one vertical stroke a pixel, and the line between.
            for (let i = from; i < to; i++) {
              if (s.ys[i] === null) { pen = false; continue; }
              const x = Math.round(X(s.xs[i])), y = Y(s.ys[i]);
              if (pen) g.lineTo(x, y); else g.moveTo(x, y);
              if (x !== column) { flush(); g.moveTo(x, y); column = x; least = most = y; } else { least = Math.min(least, y); most = Math.max(most, y); }
              pen = true;
            }
            flush();
          } else {
            for (let i = from; i < to; i++) {
              if (s.ys[i] === null) { pen = false; continue; }
              const x = X(s.xs[i]), y = Y(s.ys[i]);
              if (pen) g.lineTo(x, y); else g.moveTo(x, y);
              pen = true;
            }
          }
          g.stroke();
        }
        if (selecting) { g.fillStyle = "rgba(0,114,178,0.13)"; g.fillRect(X(selecting[0]), top, X(selecting[1]) - X(selecting[0]), bottom - top); }
        if (cursor !== null && cursor >= view[0] && cursor <= view[1]) {
          g.strokeStyle = "#5b6675"; g.lineWidth = 1; g.beginPath(); g.moveTo(X(cursor), top); g.lineTo(X(cursor), bottom); g.stroke();
          if (last) { g.fillStyle = "#1c2430"; g.textAlign = X(cursor) > right - 80 ? "right" : "left"; g.textBaseline = "top"; g.fillText(" " + compact(cursor) + " " + data.axis.split(" ").pop().replace(/[\[\]]/g, "") + " ", X(cursor), top + 3); }
        }
        g.restore();
        for (const s of series) {
          let value = "";
          if (cursor !== null) {
            const i = Math.min(lower(s.xs, cursor), s.xs.length - 1);
            const near = i > 0 && cursor - s.xs[i - 1] < s.xs[i] - cursor ? i - 1 : i;
            value = "  " + compact(s.ys[near]);
          }
          s.text.textContent = s.label + value;
        }
      }

      const timeAt = (event) => {
        const box = canvas.getBoundingClientRect();
        const share = (event.clientX - box.left - MARGIN.left) / (box.width - MARGIN.left - MARGIN.right);
        return view[0] + Math.min(Math.max(share, 0), 1) * (view[1] - view[0]);
      };
      canvas.addEventListener("wheel", (event) => {
        event.preventDefault();
        const at = timeAt(event), f = Math.exp(Math.max(-60, Math.min(60, event.deltaY)) * 0.006);
        setView(at - (at - view[0]) * f, at + (view[1] - at) * f);
      }, { passive: false });
      let drag = null;
      canvas.addEventListener("pointerdown", (event) => {
        canvas.setPointerCapture(event.pointerId);
        drag = { x: event.clientX, view: view.slice(), from: timeAt(event), select: event.shiftKey };
      });
      canvas.addEventListener("pointermove", (event) => {
        cursor = timeAt(event);
        if (drag && drag.select) selecting = [Math.min(drag.from, cursor), Math.max(drag.from, cursor)];
        else if (drag) {
          const shift = (event.clientX - drag.x) / (canvas.clientWidth - MARGIN.left - MARGIN.right) * (drag.view[1] - drag.view[0]);
          setView(drag.view[0] - shift, drag.view[1] - shift);
        }
        redraw();
      });
      canvas.addEventListener("pointerup", () => {
        if (selecting && selecting[1] > selecting[0]) setView(selecting[0], selecting[1]);
        drag = selecting = null;
        redraw();
      });
      canvas.addEventListener("pointerleave", () => { if (!drag) { cursor = null; redraw(); } });
      canvas.addEventListener("dblclick", () => setView(all[0], all[1]));
    });
    window.addEventListener("resize", redraw);
    redraw();
  }
})();
