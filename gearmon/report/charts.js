// The charts of a report: zoom, hover, switches; tables that sort. Names are set as text, never as HTML.
(function () {
  "use strict";
  const INK = "#1a1a1a", GREY = "#6b7280", BLUE = "#0072B2", SKY = "#56B4E9", RED = "#D55E00", LIGHT = "#e3e5e9";
  const VIRIDIS = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];
  const HINT = "Point at the chart for values; drag to zoom, double click to see all.";
  const pages = JSON.parse(document.getElementById("chart-data").textContent);
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const floats = (text) => Array.from(new Float32Array(bytes(text).buffer), (v) => (isNaN(v) ? null : v));
  const wave = (text, top) => Array.from(new Int16Array(bytes(text).buffer), (v) => (v * top) / 32767);
  const short = (v) => (v === null ? "–" : String(Number(v.toPrecision(3))).replace("-", "−"));
  const decibel = (v) => (v < 0 ? "−" : "+") + Math.abs(v).toFixed(1) + " dB";
  const day = (seconds) => new Date(seconds * 1e3).toISOString().slice(0, 10);
  const unique = (values) => [...new Set(values)];

  function make(tag, parent, text, settings) {
    const made = Object.assign(document.createElement(tag), settings);
    if (text) made.append(text);
    return parent.appendChild(made);
  }
  function nearest(sorted, value) { // position of the nearest number
    let low = 0, high = sorted.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (sorted[middle] < value) low = middle; else high = middle;
    }
    return value - sorted[low] < sorted[high] - value ? low : high;
  }
  function unpack(page) { // the lines of the machine, once for all charts of a recording
    if (page.lines && !page.lines.of) {
      for (const key of ["measured", "low", "high"]) page.lines[key] = page.lines[key].map(floats);
      page.lines.of = page.lines.family.map((number) => page.lines.families[number]);
      page.lines.name = page.lines.number.map((own, k) =>
        page.lines.of[k].name + (own ? `, ${own < 0 ? "−" : "+"}${Math.abs(own)}` : ""));
    }
    return page.lines;
  }
  function levelText(page, at, row) { // a line against the healthy recordings
    const { measured, low, high, of } = page.lines, { name, unit } = page.channels[row];
    const now = measured[row][at], least = low[row][at], most = high[row][at], change = of[at].changes[row];
    const beyond = least === null ? 1 : now > most ? now / most : now < least ? now / least : 1;
    return `${name}: ${short(now)} ${unit}` +
      (least === null ? "" : `, healthy recordings ${short(least)} to ${short(most)}`) +
      (beyond !== 1 && beyond > 0 && isFinite(beyond) ? ` (${decibel(20 * Math.log10(beyond))})` : "") +
      (change ? `; lines of its kind ${decibel(change[0])} against healthy, scatter ${short(change[1])} dB` : "");
  }
  function painted(map, columns, rows) { // a map as a picture of one dot a value
    const image = new ImageData(columns, rows);
    const canvas = Object.assign(document.createElement("canvas"), { width: columns, height: rows });
    map.levels = bytes(map.shades);
    map.levels.forEach((level, at) => {
      const stop = level >> 6, share = level / 64 - stop, [low, high] = [VIRIDIS[stop], VIRIDIS[stop + 1]];
      const to = 4 * ((rows - 1 - Math.floor(at / columns)) * columns + (at % columns));
      image.data.set([...low.map((shade, k) => shade + share * (high[k] - shade)), 255], to);
    });
    canvas.getContext("2d").putImageData(image, 0, 0);
    return Object.assign(map, { canvas });
  }

  function draw(host, page, chart) {
    const { kind, scale } = chart, isMap = kind === "map", isHistory = kind === "history";
    const lines = unpack(page), places = scale && lines ? lines.order.map((order) => order * scale) : [];
    const curves = chart.curves || [], values = curves.map((c) => (c.top ? wave(c.values, c.top) : floats(c.values)));
    const ranges = curves.map((c) => c.low && [floats(c.low), floats(c.high)]); // intervals
    const [first, step, count] = chart.even || [], even = () => Array.from({ length: count }, (_, k) => first + k * step);
    const x = chart.times || (count ? even() : floats(chart.x)), edge = kind === "bars" ? 0.5 : 0;
    const from = x[0] - edge, to = Math.max(x[x.length - 1], from + 1e-9) + edge;
    const maps = (chart.maps || []).map((own) => painted(own, x.length, chart.rows));
    const off = new Set(curves.filter((c) => c.off).map((c) => c.layer)), marked = new Set();
    const units = unique(page.channels.map((c) => c.unit)), unit = chart.vibration && units.length === 1 ? ` (${units[0]})` : "";
    let map = maps[0], healthy = true, line = null;

    make("h3", host, chart.title);
    const bar = make("div", host, "", { className: "switches" });
    const box = make("div", host, "", { className: "chart", tabIndex: 0, role: "group" });
    const readout = make("div", host, HINT, { className: "readout", ariaLive: "polite" });
    box.ariaLabel = `${chart.title}. Arrow keys go from line to line, plus and minus zoom, 0 shows all.`;

    const shown = (c) => !off.has(c.channel) && !off.has(c.layer);
    const rows = () => unique(curves.filter(shown).map((c) => c.channel));
    const tint = (c) => c.colour || (c.layer === "healthy" ? GREY : c.channel === null ? BLUE : page.channels[c.channel].colour);
    const chosen = () => places.map((place, k) => k).filter((k) => !marked.size || marked.has(lines.of[k].group));
    const decades = (u, splits) => splits.map((v) => (scale && !isMap && Math.abs(Math.log10(v) % 1) > 1e-6 ? null : v));
    const range = (u, low, high) => {
      // whole decades: from elsewhere uPlot may never get to the end of its marks
      if (scale) return [10 ** Math.floor(Math.log10(Math.max(low, high * 1e-6))), 10 ** Math.ceil(Math.log10(high * 1.2))];
      if (kind === "turn") return [-1, 1].map((side) => side * 1.05 * Math.max(-low, high, 1e-30));
      return [Math.min(0, low), 1.08 * Math.max(high, chart.limit || 0, chart.top || 0, 2)];
    };
    const axis = (label, size, more) => (
      { label, size, labelSize: 18, stroke: INK, labelFont: "12px sans-serif", grid: { stroke: LIGHT }, ...more });
    const bars = { paths: uPlot.paths.bars({ size: [0.8] }), fill: SKY };
    const plot = new uPlot({
      width: box.clientWidth,
      height: kind === "bars" ? 170 : 260,
      legend: { show: false },
      cursor: { drag: { x: true, y: false }, points: { show: !isMap } },
      tzDate: (seconds) => uPlot.tzDate(new Date(seconds * 1e3), "Etc/UTC"),
      scales: {
        x: { time: isHistory, range: (u, low, high) => (high - low < x[x.length - 1] - x[0] ? [low, high] : [from, to]) },
        y: isMap ? { range: chart.time } : { distr: scale ? 3 : 1, range },
      },
      axes: [axis(chart.axis, 34, isHistory && { values: (u, splits) => splits.map(day), space: 90 }), axis(chart.value + unit, 58, {
        grid: { stroke: LIGHT, filter: decades },
        ticks: { filter: decades },
        values: (u, splits) => decades(u, splits).map((v) => (v === null ? "" : short(v))),
      })],
      series: [{}, ...(isMap ? [{}] : curves.map((c) => ({
        stroke: tint(c), width: c.layer === "healthy" ? 2 : 1, show: shown(c), points: { show: isHistory && c.dots !== false, size: 5 },
        ...(kind === "bars" && bars), ...(c.dots && { paths: () => null }),
      })))],
      hooks: { drawAxes: [behind], draw: [infront], setCursor: [told] },
    }, [x, ...(isMap ? [x.map(() => null)] : values)], box);
    host.plot = plot;
    const again = () => plot.redraw(false, false);

    function upright(u, place, share, colour, dash) {
      const at = u.valToPos(place, "x", true), { left, top, width, height } = u.bbox, c = u.ctx;
      if (at < left || at > left + width) return;
      Object.assign(c, { strokeStyle: colour, lineWidth: 1 }).setLineDash(dash);
      c.beginPath(); c.moveTo(at, top + (1 - share) * height); c.lineTo(at, top + height); c.stroke(); c.setLineDash([]);
    }
    function band(u, low, high, colour) {
      const at = u.valToPos(low, "x", true);
      u.ctx.fillStyle = colour;
      u.ctx.fillRect(at, u.bbox.top, u.valToPos(high, "x", true) - at, u.bbox.height);
    }
    function interval(u, [low, high], dots, colour) { // a bar a value, or a band about a curve
      const c = u.ctx, at = (k) => u.valToPos(x[k], "x", true), up = (v) => u.valToPos(v, "y", true);
      const told = x.map((own, k) => k).filter((k) => low[k] !== null && high[k] !== null);
      Object.assign(c, { strokeStyle: colour + "88", fillStyle: colour + "22", lineWidth: 1 }).beginPath();
      if (dots) for (const k of told) { c.moveTo(at(k), up(low[k])); c.lineTo(at(k), up(high[k])); }
      else [...told.map((k) => [k, low]), ...told.reverse().map((k) => [k, high])].forEach(([k, own]) => c.lineTo(at(k), up(own[k])));
      if (dots) c.stroke(); else c.fill();
    }
    function behind(u) { // what lies under the curves
      const { left, top, width, height } = u.bbox, c = u.ctx, { min, max } = u.scales.x;
      c.save(); c.beginPath(); c.rect(left, top, width, height); c.clip();
      if (isMap) {
        const first = nearest(x, min);
        c.imageSmoothingEnabled = false;
        c.drawImage(map.canvas, first, 0, nearest(x, max) + 1 - first, chart.rows, left, top, width, height);
      }
      for (const [low, time, high] of chart.changes || []) {
        band(u, low, high, "rgba(107,114,128,.13)");
        upright(u, time, 1, GREY, [4, 4]);
      }
      curves.forEach((own, k) => ranges[k] && shown(own) && interval(u, ranges[k], own.dots, tint(own)));
      if (chart.marked) band(u, chart.marked - 1, chart.marked + 1, "rgba(213,94,0,.18)");
      if (chart.limit) { c.fillStyle = RED; c.fillRect(left, u.valToPos(chart.limit, "y", true), width, 2); }
      for (const at of marked.size ? chosen() : []) {
        const { mesh, reach } = lines.of[at], place = places[at], reached = place * reach;
        if (place < min || place > max) continue;
        if (reach) band(u, place - reached, place + reached, "rgba(0,114,178,.12)");
        upright(u, place, mesh ? 1 : 0.12, mesh ? BLUE : GREY, mesh ? [4, 4] : []);
        for (const row of healthy ? rows() : []) {
          if (!(lines.high[row] && lines.high[row][at] > 0)) continue;
          const [high, low] = [lines.high, lines.low].map((own) => u.valToPos(Math.max(own[row][at], 1e-30), "y", true));
          c.fillStyle = page.channels[row].colour + "66"; // the last two digits: seen through
          c.fillRect(u.valToPos(place, "x", true) - 4, high, 8, Math.max(3, low - high));
        }
      }
      c.restore();
    }
    function infront(u) {
      if (line !== null) upright(u, places[line], 1, RED, [2, 2]);
    }
    function told(u) { // what is under the cursor, in words
      const { left, top, idx } = u.cursor, said = [];
      if (idx === null || idx === undefined || left < 0) return;
      const at = u.posToVal(left, "x"), order = at / (scale || 1);
      const name = (c) => (c.channel === null ? c.layer : page.channels[c.channel].name + (scale ? "" : ` ${c.layer}`));
      const sure = (k) => (ranges[k] ? ` (${short(ranges[k][0][idx])} to ${short(ranges[k][1][idx])})` : "");
      const what = (c) => (ranges.some(Boolean) ? (c.dots ? ", this recording" : ", trend") : "");
      const here = curves.map((c, k) => (shown(c) && !(isHistory && values[k][idx] === null)
        ? `${name(c)}${what(c)} ${short(values[k][idx])}${sure(k)}` : "")).filter(Boolean).join(", ");
      if (isMap) {
        const second = u.posToVal(top, "y"), share = (second - chart.time[0]) / (chart.time[1] - chart.time[0]);
        const row = Math.min(chart.rows - 1, Math.max(0, Math.floor(share * chart.rows)));
        const level = map.levels[row * x.length + idx], size = map.top * 10 ** (map.decades * (level / 255 - 1));
        said.push(`${second.toFixed(2)} s: ${level ? "" : "below "}${short(size)} ${page.channels[map.channel].unit}`);
      }
      if (scale) {
        said.unshift(`${(order * page.speed_hz).toFixed(2)} Hz, order ${order.toFixed(3)}: ${here}`);
        const among = chosen(), found = among[nearest(among.map((k) => places[k]), at)];
        const where = `${(lines.order[found] * page.speed_hz).toFixed(2)} Hz, order ${Number(lines.order[found].toFixed(4))}`;
        said.push(`Nearest line: ${lines.name[found]} (${where})`);
        if (lines.measured.length) said.push(...rows().map((row) => levelText(page, found, row)));
        if (found !== line) { line = found; again(); }
      } else if (isHistory) said.push(`${day(x[idx])}, ${page.told[idx]}`, here);
      else if (!chart.teeth) said.push(`${chart.axis} ${at.toFixed(1)}: ${here}`);
      else said.push(`Tooth ${((Math.round(at) - 1 + chart.teeth) % chart.teeth) + 1} of ${chart.teeth}: ${here}`);
      readout.replaceChildren(...said.map((text) => Object.assign(document.createElement("div"), { textContent: text })));
    }

    function toggle(name, on, colour, act) {
      const label = make("label", bar), input = make("input", label, "", { type: "checkbox", checked: on });
      label.append(name);
      label.style.borderColor = colour;
      input.addEventListener("change", () => act(input.checked));
      act(on);
    }
    function choice(ariaLabel, options, act) {
      const pick = make("select", bar, "", { ariaLabel });
      options.forEach((text, value) => make("option", pick, text, { value }));
      pick.addEventListener("change", () => act(Number(pick.value)));
    }
    const layer = (key) => (on) => {
      off[on ? "delete" : "add"](key);
      curves.forEach((c, k) => plot.series[k + 1].show !== shown(c) && plot.setSeries(k + 1, { show: shown(c) }));
    };
    const channels = unique(curves.map((c) => c.channel)), layers = unique(curves.map((c) => c.layer));
    if (channels.length > 1) channels.forEach((row, k) =>
      toggle(page.channels[row].name, k < (scale ? 2 : 1), page.channels[row].colour, layer(row)));
    if (layers.length > 1) layers.forEach((own) => toggle(own, !off.has(own), tint(curves.find((c) => c.layer === own)), layer(own)));
    for (const group of places.length ? lines.groups : [])
      toggle(group, group.startsWith("mesh"), GREY, (on) => { marked[on ? "add" : "delete"](group); again(); });
    if (places.length && !isMap && lines.low.flat().some((v) => v !== null)) toggle("healthy", true, GREY, (on) => { healthy = on; again(); });
    if (maps.length > 1) choice("Channel", maps.map((own) => page.channels[own.channel].name), (k) => { map = maps[k]; again(); });

    const span = () => plot.scales.x.max - plot.scales.x.min;
    const focus = () => (plot.cursor.left > 0 ? plot.posToVal(plot.cursor.left, "x") : (plot.scales.x.min + plot.scales.x.max) / 2);
    const view = (centre, width) => {
      const wide = Math.min(width, to - from), min = Math.min(Math.max(centre - wide / 2, from), to - wide);
      plot.setScale("x", { min, max: min + wide });
    };
    const walk = (way) => {
      const stops = places.length ? chosen().map((k) => places[k]) : x;
      const place = stops[Math.min(stops.length - 1, Math.max(0, nearest(stops, focus()) + way))];
      if (place < plot.scales.x.min || place > plot.scales.x.max) view(place, span());
      plot.setCursor({ left: plot.valToPos(place, "x"), top: 60 });
    };
    const keys = {
      "+": [() => view(focus(), span() / 2), "Zoom in"], "-": [() => view(focus(), span() * 2), "Zoom out"], 0: [() => view(0, to), "Show all"],
      ArrowLeft: [() => walk(-1), "Line before"], ArrowRight: [() => walk(1), "Next line"],
    };
    for (const [sign, key] of [["+", "+"], ["−", "-"], ["all", "0"], ["‹", "ArrowLeft"], ["›", "ArrowRight"]])
      make("button", bar, sign, { type: "button", title: keys[key][1], ariaLabel: keys[key][1] }).addEventListener("click", keys[key][0]);
    box.addEventListener("keydown", (event) => { if (keys[event.key]) { keys[event.key][0](); event.preventDefault(); } });
    const meshes = places.length && !isMap ? places.map((place, k) => k).filter((k) => lines.of[k].mesh) : [];
    if (meshes.length) choice("Zoom to a mesh harmonic", ["zoom to …", ...meshes.map((k) => lines.name[k])],
      (k) => (k ? view(places[meshes[k - 1]], 14 * scale) : view(0, to)));
    new ResizeObserver(() => box.clientWidth && box.clientWidth !== plot.width && plot.setSize({ width: box.clientWidth, height: plot.height })).observe(box);
  }

  const content = (row, column) => row.cells[column].textContent.trim().replace("−", "-");
  function sortable(table) {
    [...table.tHead.rows[0].cells].forEach((head, column) => {
      const button = make("button", head, head.textContent, { type: "button" });
      head.replaceChildren(button);
      button.addEventListener("click", () => {
        const way = head.ariaSort === "descending" ? 1 : -1;
        const order = (a, b) => parseFloat(a) - parseFloat(b) || a.localeCompare(b);
        for (const other of table.tHead.rows[0].cells) other.ariaSort = null;
        head.ariaSort = way > 0 ? "ascending" : "descending";
        table.tBodies[0].append(...[...table.tBodies[0].rows].sort((a, b) => way * order(content(a, column), content(b, column))));
      });
    });
  }
  // charts are drawn when they come near the window: a long page opens at once
  const near = new IntersectionObserver((seen) => seen.filter((own) => own.isIntersecting).forEach(({ target }) => {
    near.unobserve(target);
    draw(target, pages[target.dataset.of], pages[target.dataset.of].charts[target.dataset.number]);
    target.classList.remove("waiting");
  }), { rootMargin: "400px" });
  document.querySelectorAll(".charts").forEach((holder) => {
    holder.hidden = false;
    pages[holder.dataset.of].charts.forEach((chart, number) => {
      const host = make("div", holder, "", { className: `one ${chart.kind} waiting`, id: `${holder.dataset.of}-${chart.name}` });
      Object.assign(host.dataset, { of: holder.dataset.of, number });
      near.observe(host);
    });
  });
  document.querySelectorAll("table.sorts").forEach(sortable);
})();
