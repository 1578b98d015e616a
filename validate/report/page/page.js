// The page of a report when scripts run: a body that turns, curves that zoom, tables that sort.
// Without it every still picture and every row is there. No request is made.
"use strict";
(() => {
  const make = (tag, attributes = {}, ...children) => {
    const one = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) {
      if (name in one && typeof value !== "string") one[name] = value;
      else one.setAttribute(name, value);
    }
    one.append(...children);
    return one;
  };
  const style = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const written = (x, y, words, more = "") => { // words in a drawing, escaped
    const one = make("span", {}, String(words));
    return `<text x="${x}" y="${y}" ${more}>${one.innerHTML}</text>`;
  };
  const saved = (name, drawing) => {
    const link = make("a", { href: URL.createObjectURL(new Blob([drawing], { type: "image/svg+xml" })), download: `${name}.svg` });
    link.click();
    URL.revokeObjectURL(link.href);
  };
  const shown = value => {
    if (value == null) return "–";
    const near = Number(value.toPrecision(4)), size = Math.abs(near);
    return (near && (size < 1e-3 || size >= 1e6) ? near.toExponential() : String(near)).replaceAll("-", "−").replace("e+", "e");
  };

  // --- sections: a link opens what it leads to --------------------------------------------------

  const open = () => {
    const target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    if (!target) return;
    for (let d = target.closest("details"); d; d = d.parentElement.closest("details")) d.open = true;
    target.scrollIntoView();
  };
  addEventListener("hashchange", open);

  // --- tables: sorted by their headings, filtered by a text ------------------------------------

  const FILTERED_FROM = 4; // rows

  function table(one) {
    for (const heading of one.tHead.rows[0].cells) {
      heading.tabIndex = 0;
      heading.addEventListener("keydown", event => {
        if (event.key !== "Enter" && event.key !== " ") return;
        event.preventDefault();
        heading.click();
      });
    }
    const below = new Map(); // the line of words that belongs to a row, while rows are sorted
    one.addEventListener("sort-start", () => {
      for (const line of one.querySelectorAll("tr.below")) {
        below.set(line.previousElementSibling, line);
      }
      for (const line of below.values()) line.remove();
    });
    one.addEventListener("sort-end", () => below.forEach((line, row) => row.after(line)));
    const box = one.closest(".table");
    const rows = [...one.tBodies[0].rows].filter(row => !row.classList.contains("below"));
    if (rows.length < FILTERED_FROM) return;
    const caption = box.previousElementSibling;
    const field = make("input", { type: "search", class: "filter", placeholder: "Filter rows",
      "aria-label": `Filter the rows of: ${caption.textContent.slice(0, 60)}` });
    field.addEventListener("input", () => {
      const wanted = field.value.toLowerCase();
      const fold = box.querySelector(".unfold");
      if (fold && wanted) fold.checked = true;
      for (const row of rows) {
        const other = row.nextElementSibling;
        const line = other && other.classList.contains("below") ? other : null;
        const text = row.textContent + (line ? line.textContent : "");
        const out = !text.toLowerCase().includes(wanted);
        row.classList.toggle("filtered", out);
        if (line) line.classList.toggle("filtered", out);
      }
    });
    box.querySelector(".scroll").before(field);
  }

  // --- curves: uPlot ----------------------------------------------------------------------------

  const HEIGHT = 300;
  const read = (u, value) => value == null ? "" : shown(value); // at the pointer

  function curves(figure, script) {
    const found = JSON.parse(script.textContent);
    const ink = style("--ink");
    const colour = given => given === "#000000" ? ink : given;
    const positive = (values, axis) =>
      found.log.includes(axis) && !found.linear ? values.map(v => v > 0 ? v : null) : values;
    for (const s of found.series) s.x = found.xs[s.x];
    const tables = [], series = [{ label: found.x, value: read }], bands = [];
    const seen = new Set(), solid = new Set(found.series.filter(s => s.style !== "band").map(s => s.label));
    for (const s of found.series) {
      const number = series.length;
      const look = { label: s.label, stroke: colour(s.colour), width: s.width, dash: s.dash,
        show: !s.hidden, mark: s.style, value: read, points: { show: false } };
      if (s.style === "points") {
        Object.assign(look, { paths: () => null, points: { show: true, size: 5, fill: colour(s.colour) } });
      }
      if (s.style === "band") {
        if (solid.has(s.label)) look.class = "branch"; // its line or points stand for it
        series.push({ ...look, width: 0 }, { ...look, width: 0, class: "branch" });
        tables.push([s.x, positive(s.y, "y"), positive(s.upper, "y")]);
        bands.push({ series: [number + 1, number], fill: `${s.colour}40` });
      } else {
        if (seen.has(s.label)) look.class = "branch";
        seen.add(s.label);
        series.push(look);
        tables.push([s.x, positive(s.y, "y")]);
      }
    }
    const ends = found.series.flatMap(s => s.x.length ? [s.x[0], s.x.at(-1)] : []);
    const [low, high] = ends.length ? [Math.min(...ends), Math.max(...ends)] : [0, 1];
    for (const level of found.levels) {
      series.push({ label: level.label, stroke: ink, width: 1, dash: [6, 4], mark: "line",
        value: read, points: { show: false } });
      tables.push([low < high ? [low, high] : [low], low < high ? [level.y, level.y] : [level.y]]);
    }
    const padded = (u, from, to) => [from - 0.05 * (to - from || 1), to + 0.05 * (to - from || 1)];
    const scale = axis => {
      if (axis === "y" && found.linear) return { distr: 4, asinh: found.linear, range: padded };
      return found.log.includes(axis) ? { distr: 3 } : {};
    };
    const decades = (u, ticks) => { // of a logarithmic axis: zero and powers of ten, at most some 7
      const powers = ticks.map(v => Math.log10(Math.abs(v))).map(p => Math.abs(p - Math.round(p)) < 1e-9 ? Math.round(p) : NaN);
      const there = powers.filter(Number.isFinite), count = Math.max(...there) - Math.min(...there) + 1;
      if (there.length < 2) return ticks;
      const every = Math.ceil((ticks.some(v => v < 0) ? 2 : 1) * count / 7);
      return ticks.map((v, i) => v === 0 || powers[i] % every === 0 ? v : null);
    };
    const roomy = (u, ticks) => { // of an axis about zero: zero, then the largest ones that have room
      const kept = [], at = v => u.valToPos(v, "y");
      for (const v of [...decades(u, ticks)].filter(v => v != null).sort((a, b) => (b === 0) - (a === 0) || Math.abs(b) - Math.abs(a))) {
        if (kept.every(k => Math.abs(at(k) - at(v)) > 20)) kept.push(v);
      }
      return ticks.map(v => kept.includes(v) ? v : null);
    };
    const axis = (label, name) => {
      const filter = name === "y" && found.linear ? { filter: roomy } : found.log.includes(name) ? { filter: decades } : {};
      return { label, stroke: ink, labelSize: 22, ...filter, grid: { stroke: style("--line"), width: 1, ...filter },
        ticks: { stroke: style("--line"), width: 1, ...filter }, values: (u, ticks) => ticks.map(v => v == null ? "" : shown(v)) };
    };
    const box = make("div", { class: "plotted" });
    figure.prepend(box);
    let together = false; // branches of one curve are shown and hidden as one
    const drawn = new uPlot({
      width: Math.max(280, figure.clientWidth), height: HEIGHT, series, bands,
      scales: { x: { time: false, ...scale("x") }, y: scale("y") },
      axes: [axis(found.x, "x"), { ...axis(found.y, "y"), size: 62 }],
      cursor: { drag: { x: true, y: true, uni: 20 } },
      hooks: { setSeries: [(u, number, options) => {
        if (together || number == null || options.show == null) return;
        together = true;
        u.series.forEach((s, i) => {
          if (i !== number && s.label === u.series[number].label) u.setSeries(i, { show: options.show });
        });
        together = false;
      }] },
    }, uPlot.join(tables), box);
    box.querySelectorAll(".u-series").forEach((row, i) => {
      row.hidden = row.classList.contains("branch");
      if (i) row.querySelector(".u-marker").outerHTML = sample(drawn.series[i], series[i].stroke);
    });
    const save = make("button", { type: "button" }, "Save SVG");
    save.addEventListener("click", () => saved(figure.id, vector(drawn)));
    box.append(make("p", { class: "note" },
      "Drag to zoom, double-click to see all, click a name to hide or show it. ", save));
    figure.classList.add("live");
    new ResizeObserver(() => {
      if (figure.clientWidth) drawn.setSize({ width: figure.clientWidth, height: HEIGHT });
    }).observe(figure);
  }

  // What stands for a curve in a legend: as it is drawn, so that dashes are told apart.
  function sample(s, colour, at = "") {
    const marks = {
      band: `<rect y="2" width="28" height="8" fill="${colour}" fill-opacity="0.25"/>`,
      points: `<circle cx="14" cy="6" r="3" fill="${colour}"/>`,
      line: `<line y1="6" x2="28" y2="6" stroke="${colour}" stroke-width="2" stroke-dasharray="${(s.dash || []).join(" ")}"/>`,
    };
    return `<svg class="u-marker" ${at} width="28" height="12" aria-hidden="true">${marks[s.mark]}</svg>`;
  }

  // The curves of a plot as it is shown, black on white: for a document.
  function vector(plot) {
    const [left, top] = [plot.over.offsetLeft, plot.over.offsetTop];
    const [wide, high] = [plot.over.clientWidth, plot.over.clientHeight];
    const at = (v, scale) => (plot.valToPos(v, scale) + (scale === "x" ? left : top)).toFixed(1);
    const ends = plot.bands.flatMap(b => b.series);
    const lines = [], names = new Map();
    const points = i => plot.data[0].flatMap((x, k) =>
      plot.data[i][k] == null ? [] : [`${at(x, "x")},${at(plot.data[i][k], "y")}`]);
    const print = one => one === style("--ink") ? "#000000" : one;
    plot.series.forEach((s, i) => {
      if (!i || !s.show) return;
      const colour = print(s._stroke || s.stroke());
      if (!names.has(s.label)) names.set(s.label, [s, colour]);
      if (ends.includes(i)) return;
      if (s.mark === "points") {
        for (const point of points(i)) {
          const [x, y] = point.split(",");
          lines.push(`<circle cx="${x}" cy="${y}" r="2.5" fill="${colour}"/>`);
        }
      } else {
        lines.push(`<polyline points="${points(i).join(" ")}" fill="none" stroke="${colour}" stroke-width="${s.width}" stroke-dasharray="${(s.dash || []).join(" ")}"/>`);
      }
    });
    for (const b of plot.bands) {
      if (!plot.series[b.series[0]].show) continue;
      const [upper, lower] = b.series.map(points);
      lines.unshift(`<polygon points="${[...upper, ...lower.reverse()].join(" ")}" fill="${print(plot.series[b.series[0]].stroke())}" fill-opacity="0.25"/>`);
    }
    const [across, upward] = plot.axes.map(a => a._splits.map((v, i) => [v, a._values[i]]).filter(t => t[1] !== ""));
    const frame = `<rect x="${left}" y="${top}" width="${wide}" height="${high}" fill="none" stroke="#000000"/>`;
    const ticks = [
      ...across.map(([v, words]) => written(at(v, "x"), top + high + 16, words, 'text-anchor="middle"')),
      ...upward.map(([v, words]) => written(left - 6, Number(at(v, "y")) + 4, words, 'text-anchor="end"')),
      written(left + wide / 2, top + high + 34, plot.axes[0].label, 'text-anchor="middle"'),
      written(0, 0, plot.axes[1].label, `text-anchor="middle" transform="translate(14 ${top + high / 2}) rotate(-90)"`),
    ];
    const legend = [...names].map(([name, [s, colour]], i) =>
      sample(s, colour, `x="${left}" y="${top + high + 44 + 16 * i}"`) + written(left + 34, top + high + 54 + 16 * i, name));
    const size = [plot.width, top + high + 60 + 16 * names.size];
    return `<svg xmlns="http://www.w3.org/2000/svg" width="${size[0]}" height="${size[1]}" font-family="sans-serif" font-size="12"><rect width="100%" height="100%" fill="#ffffff"/><clipPath id="inside"><rect x="${left}" y="${top}" width="${wide}" height="${high}"/></clipPath><g clip-path="url(#inside)">${lines.join("")}</g>${frame}${ticks.join("")}${legend.join("")}</svg>`;
  }

  // --- other figures: saved as they are, black on white ------------------------------------------

  const paper = { good: "#00543c", bad: "#8e0015", open: "#5f4500" };

  function forest(figure) { // its lines, with the words of each beside it
    const rows = [...figure.querySelectorAll("tbody tr")];
    const text = (row, of) => row.querySelector(of).textContent.replaceAll("\u200b", "").trim();
    const most = of => 7 * Math.max(...rows.map(row => text(row, of).length));
    const [left, wide, high] = [most("th") + 12, 320, 22];
    const at = (span, side) => wide * parseFloat(span.style[side]) / 100;
    const lines = rows.map((row, i) => {
      const [within, zero, whisker, dot] = row.querySelectorAll(".track span"), y = 30 + high * i;
      const colour = paper[row.className] || "#000000";
      return written(left - 8, y + 4, text(row, "th"), 'text-anchor="end"')
        + `<g transform="translate(${left} ${y})"><rect x="${at(within, "left")}" y="${-high / 2}" width="${at(within, "width")}" height="${high}" fill="#dfe5ea"/>`
        + `<path d="M${at(zero, "left")} ${-high / 2}v${high}" stroke="#565f66"/>`
        + `<path d="M${at(whisker, "left")} 0h${at(whisker, "width")}" stroke="${colour}" stroke-width="3"/>`
        + `<circle cx="${at(dot, "left")}" r="4.5" fill="${colour}"/></g>`
        + written(left + wide + 10, y + 4, `${text(row, ".numbers")}: ${text(row, ".answer")}`, `fill="${colour}"`);
    });
    const size = [left + wide + 24 + most(".numbers") + most(".answer"), 30 + high * rows.length];
    return `<svg xmlns="http://www.w3.org/2000/svg" width="${size[0]}" height="${size[1]}" font-family="sans-serif" font-size="12"><rect width="100%" height="100%" fill="#ffffff"/>${written(left, 14, text(figure, "thead .track"))}${lines.join("")}</svg>`;
  }

  function picture(image) {
    const [wide, high] = [image.naturalWidth, image.naturalHeight];
    return `<svg xmlns="http://www.w3.org/2000/svg" width="${wide}" height="${high}"><title>${make("span", {}, image.alt).innerHTML}</title><image width="${wide}" height="${high}" href="${image.src}"/></svg>`;
  }

  function saver(figure) {
    const image = () => [...figure.querySelectorAll("img")].find(one => one.clientWidth);
    const button = make("button", { type: "button" }, "Save SVG");
    button.addEventListener("click", () =>
      saved(figure.id, figure.matches(".forest-figure") ? forest(figure) : picture(image())));
    const note = make("p", { class: "note" }, button);
    const caption = figure.querySelector("figcaption");
    if (caption) caption.before(note); else figure.append(note);
  }

  // --- images: one at a time ---------------------------------------------------------------------

  function series(box) {
    const images = [...box.children], last = images.length - 1;
    const slider = make("input", { type: "range", min: "0", max: String(last), step: "1", "aria-label": "load or time" });
    const output = make("output", {});
    const show = () => {
      images.forEach((one, i) => { one.hidden = i !== Number(slider.value); });
      output.textContent = images[slider.value].textContent;
    };
    slider.value = String(last);
    slider.addEventListener("input", show);
    if (last) box.before(make("div", { class: "controls slider" }, slider, output));
    box.classList.add("live");
    show();
  }

  // --- the body: three.js -----------------------------------------------------------------------

  const VIRIDIS = ["#440154", "#46327e", "#365c8d", "#277f8e", "#1fa187", "#4ac16d", "#a0da39", "#fde725"];
  const ORANGE = "#d55e00", BLUE = "#0072b2", GREY = "#c9ced3", PROBE = "#ffffff";
  const STEPS = 32767;

  const numbers = (text, Kind) => {
    const bytes = Uint8Array.from(atob(text), c => c.charCodeAt(0));
    return new Kind(bytes.buffer);
  };

  function body(figure, script) {
    const view = JSON.parse(script.textContent);
    const canvas = make("canvas", { tabindex: "0", role: "img" });
    let renderer;
    try {
      renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
    } catch {
      return; // no WebGL: the still picture stays
    }
    const ramp = VIRIDIS.map(c => new THREE.Color(c));
    const coloured = share => {
      const x = Math.min(Math.max(share, 0), 1) * (ramp.length - 1), i = Math.min(Math.floor(x), ramp.length - 2);
      return ramp[i].clone().lerp(ramp[i + 1], x - i);
    };
    const methods = view.methods.map(unpacked);
    const frames = view.labels.length;

    // What is shown.
    const state = { method: 0, other: -1, frame: largest(methods[0]), by: "displacement",
      markers: true, arrows: magnified(), outline: true, probes: true, edges: false,
      through: methods.some(m => m.markers && m.markers.inside), cut: Boolean(view.cut), scale: 1 };

    function unpacked(m) {
      const nodes = numbers(m.nodes, Float32Array);
      const triangles = m.parts.map(p => numbers(p.triangles, Uint32Array));
      const shares = ({ top, shares }) => Float32Array.from(numbers(shares, Int16Array), v => v * top / STEPS);
      const fields = Object.fromEntries(Object.entries(m.fields).map(([name, f]) => [name, shares(f)]));
      const markers = m.markers && { names: m.markers.names, inside: m.markers.inside,
        rest: numbers(m.markers.rest, Float32Array), measured: numbers(m.markers.measured, Float32Array), simulated: numbers(m.markers.simulated, Float32Array) };
      const outlines = m.outlines && m.outlines.map(o => ({
        measured: numbers(o.measured, Float32Array), simulated: numbers(o.simulated, Float32Array) }));
      const probes = m.probes && { rest: numbers(m.probes.rest, Float32Array), moved: numbers(m.probes.moved, Float32Array) };
      return { ...m, packed: m.nodes, nodes, triangles, u: shares(m.u), fields, markers, outlines, probes };
    }

    function largest(m) {
      const size = m.nodes.length;
      let best = 0, top = -1;
      for (let f = 0; f < frames; f++) {
        let here = 0;
        for (let i = 0; i < size; i++) here = Math.max(here, Math.abs(m.u[f * size + i]));
        if (here >= top) [best, top] = [f, here];
      }
      return best;
    }

    function magnified() { // 1, 2, 5 or 10: the longest arrow is at most 8 % of the body
      const m = methods.find(m => m.markers);
      let top = 0;
      for (let f = 0; m && f < frames; f++) for (const e of errors(m, f)) if (e > top) top = e;
      return [10, 5, 2].find(by => by * top <= 0.08 * view.size) ?? 1;
    }

    const length = (a, i) => Math.hypot(a[i], a[i + 1], a[i + 2]);

    function values(m, by, f) { // of every drawn node in frame f
      const n = m.nodes.length / 3, found = new Float32Array(n);
      if (m.fields[by]) return m.fields[by].subarray(f * n, (f + 1) * n);
      const other = by.startsWith("difference ") && methods[Number(by.slice(11))];
      for (let i = 0; i < n; i++) {
        const at = 3 * (f * n + i);
        found[i] = other
          ? Math.hypot(m.u[at] - other.u[at], m.u[at + 1] - other.u[at + 1], m.u[at + 2] - other.u[at + 2])
          : length(m.u, at);
      }
      return found;
    }

    function errors(m, f) { // of every marker in frame f; NaN: not seen
      const k = m.markers.names.length;
      return Float32Array.from({ length: k }, (_, i) => {
        const at = 3 * (f * k + i), a = m.markers.measured, b = m.markers.simulated;
        return Math.hypot(a[at] - b[at], a[at + 1] - b[at + 1], a[at + 2] - b[at + 2]);
      });
    }

    const ranges = new Map(); // of a colour over all frames and methods: pictures can be compared
    function range(by) {
      if (!ranges.has(by)) {
        let low = Infinity, high = -Infinity;
        for (const m of methods) {
          if (by === "error" ? !m.markers : by.includes(" / ") && !m.fields[by]) continue;
          if (by.startsWith("difference ") && methods[Number(by.slice(11))].packed !== m.packed) continue;
          for (let f = 0; f < frames; f++) {
            for (const v of by === "error" ? errors(m, f) : values(m, by, f)) {
              if (v < low) low = v;
              if (v > high) high = v;
            }
          }
        }
        const length = by === "displacement" || by === "error" || by.startsWith("difference");
        ranges.set(by, [length ? 0 : low, high > low ? high : low + 1e-12]);
      }
      return ranges.get(by);
    }

    const held = view.camera.half; // to the right and upward, of what the camera holds in its first place, mm

    // One pane a method, all with one camera.
    const camera = new THREE.OrthographicCamera(-1, 1, 1, -1, -20 * view.size, 20 * view.size);
    const plane = view.cut && new THREE.Plane(new THREE.Vector3(...view.cut.normal).negate(), view.cut.at);
    renderer.localClippingEnabled = true;
    const panes = methods.map(pane);

    function pane(m) {
      const scene = new THREE.Scene();
      const light = new THREE.DirectionalLight("#ffffff", 1.6);
      scene.background = new THREE.Color(style("--canvas"));
      scene.add(new THREE.AmbientLight("#ffffff", 1.7), light);
      const place = new THREE.BufferAttribute(new Float32Array(m.nodes.length), 3);
      const tint = new THREE.BufferAttribute(new Float32Array(m.nodes.length), 3);
      const material = new THREE.MeshLambertMaterial({ vertexColors: true, side: THREE.DoubleSide, flatShading: true });
      const lines = new THREE.LineBasicMaterial({ color: "#303030", transparent: true, opacity: 0.45 });
      const parts = m.triangles.map(index => {
        const geometry = new THREE.BufferGeometry();
        geometry.setAttribute("position", place).setAttribute("color", tint);
        geometry.setIndex(new THREE.BufferAttribute(index, 1));
        const edges = new THREE.BufferGeometry();
        edges.setAttribute("position", place);
        edges.setIndex(new THREE.BufferAttribute(edgesOf(index), 1));
        const wire = new THREE.LineSegments(edges, lines);
        scene.add(new THREE.Mesh(geometry, material), wire);
        wire.frustumCulled = scene.children.at(-2).frustumCulled = false;
        return { wire };
      });
      const tools = view.tools.map(t => {
        const geometry = new THREE.BufferGeometry();
        geometry.setAttribute("position", new THREE.BufferAttribute(numbers(t.nodes, Float32Array), 3));
        geometry.setIndex(new THREE.BufferAttribute(numbers(t.triangles, Uint32Array), 1));
        geometry.computeVertexNormals();
        const solid = new THREE.Mesh(geometry, new THREE.MeshLambertMaterial(
          { color: "#a9b0b7", transparent: true, opacity: 0.35, side: THREE.DoubleSide, depthWrite: false }));
        scene.add(solid);
        return { solid, shifts: numbers(t.shifts, Float32Array) };
      });
      const k = m.markers ? m.markers.names.length : 0;
      const radius = 0.006 * view.size * Math.min(1, Math.sqrt(60 / Math.max(k, 1)));
      const balls = new THREE.InstancedMesh(new THREE.SphereGeometry(radius, 14, 10),
        new THREE.MeshLambertMaterial({ color: "#ffffff" }), Math.max(k, 1));
      const cones = new THREE.InstancedMesh(new THREE.CylinderGeometry(0, 0.55 * radius, 1, 10),
        new THREE.MeshLambertMaterial({ color: ORANGE }), Math.max(k, 1));
      const loop = colour => new THREE.LineLoop(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ color: colour }));
      const measured = loop("#000000"), simulated = loop(BLUE);
      const probes = new THREE.InstancedMesh(new THREE.SphereGeometry(0.0055 * view.size, 4, 2), // a diamond, smaller than a marker
        new THREE.MeshLambertMaterial({ color: PROBE }), m.probes ? m.probes.rest.length / 3 : 1);
      for (const one of [balls, cones, measured, simulated, probes]) one.frustumCulled = false;
      scene.add(balls, cones, measured, simulated, probes);
      return { m, scene, light, place, tint, material, lines, parts, tools, balls, cones, measured, simulated, probes };
    }

    function edgesOf(index) {
      const seen = new Set(), found = [];
      for (let t = 0; t < index.length; t += 3) {
        for (const [i, j] of [[0, 1], [1, 2], [2, 0]]) {
          const a = Math.min(index[t + i], index[t + j]), b = Math.max(index[t + i], index[t + j]);
          const key = a * 4194304 + b;
          if (!seen.has(key)) { seen.add(key); found.push(a, b); }
        }
      }
      return Uint32Array.from(found);
    }

    function fill(p) {
      const { m } = p, f = state.frame, n = m.nodes.length / 3;
      for (let i = 0; i < 3 * n; i++) p.place.array[i] = m.nodes[i] + state.scale * m.u[3 * f * n + i];
      const of = state.by.startsWith("difference ") && methods[Number(state.by.slice(11))];
      const plain = state.by === "error" || (state.by.includes(" / ") && !m.fields[state.by]) || (of && of.packed !== m.packed);
      const [low, high] = range(state.by);
      if (plain) {
        const grey = new THREE.Color(GREY);
        for (let i = 0; i < n; i++) grey.toArray(p.tint.array, 3 * i);
      } else {
        const found = values(m, state.by, f);
        for (let i = 0; i < n; i++) coloured((found[i] - low) / (high - low)).toArray(p.tint.array, 3 * i);
      }
      p.place.needsUpdate = p.tint.needsUpdate = true;
      p.material.clippingPlanes = p.lines.clippingPlanes = state.cut && plane ? [plane] : [];
      for (const { wire } of p.parts) wire.visible = state.edges;
      p.material.transparent = state.through;
      p.material.opacity = state.through ? 0.35 : 1;
      p.material.depthWrite = !state.through;
      for (const { solid, shifts } of p.tools) {
        solid.position.set(...shifts.subarray(3 * f, 3 * f + 3).map(v => state.scale * v));
      }
      points(p, f, low, high);
      p.probes.visible = Boolean(m.probes) && state.probes;
      if (m.probes) {
        const { rest, moved } = m.probes, k = rest.length / 3, mover = new THREE.Object3D();
        for (let i = 0; i < k; i++) {
          const [x, y, z] = [0, 1, 2].map(c => rest[3 * i + c] + state.scale * (moved[3 * (f * k + i) + c] - rest[3 * i + c]));
          mover.position.set(x, y, z);
          mover.updateMatrix();
          p.probes.setMatrixAt(i, mover.matrix);
        }
        p.probes.instanceMatrix.needsUpdate = true;
      }
      const outline = state.outline && state.scale === 1 && m.outlines; // it has no points to scale
      for (const name of ["measured", "simulated"]) {
        p[name].visible = Boolean(outline);
        if (outline) {
          p[name].geometry.dispose();
          p[name].geometry = new THREE.BufferGeometry();
          p[name].geometry.setAttribute("position", new THREE.BufferAttribute(m.outlines[f][name], 3));
        }
      }
    }

    function points(p, f, low, high) {
      const { m } = p;
      p.balls.visible = Boolean(m.markers) && state.markers;
      p.cones.visible = Boolean(m.markers) && state.markers && state.arrows > 0;
      if (!m.markers) return;
      const k = m.markers.names.length, mover = new THREE.Object3D(), up = new THREE.Vector3(0, 1, 0);
      const found = errors(m, f);
      for (let i = 0; i < k; i++) {
        const at = 3 * (f * k + i);
        const rest = new THREE.Vector3(...m.markers.rest.subarray(3 * i, 3 * i + 3));
        const moved = place => new THREE.Vector3(...place.subarray(at, at + 3)).sub(rest).multiplyScalar(state.scale).add(rest);
        const end = moved(m.markers.measured), start = moved(m.markers.simulated);
        const there = Number.isFinite(found[i]);
        mover.position.copy(there ? end : start);
        mover.quaternion.identity();
        mover.scale.setScalar(there ? 1 : 0);
        mover.updateMatrix();
        p.balls.setMatrixAt(i, mover.matrix);
        p.balls.setColorAt(i, state.by === "error" && there ? coloured(found[i] / high) : new THREE.Color("#111111"));
        const arrow = end.clone().sub(start).multiplyScalar(state.arrows || 1), size = arrow.length();
        if (there && size > 1e-6) {
          mover.position.copy(end).addScaledVector(arrow, -0.5);
          mover.quaternion.setFromUnitVectors(up, arrow.normalize());
          mover.scale.set(1, size, 1);
        } else mover.scale.setScalar(0);
        mover.updateMatrix();
        p.cones.setMatrixAt(i, mover.matrix);
      }
      p.balls.instanceMatrix.needsUpdate = p.cones.instanceMatrix.needsUpdate = true;
      p.balls.instanceColor.needsUpdate = true;
    }

    // From where it is seen: as the still pictures see it.
    const [middle, away, up] = [view.camera.middle, view.camera.away, view.camera.up].map(v => new THREE.Vector3(...v));
    camera.up.copy(up); // before the controls, which read it once
    const controls = new THREE.OrbitControls(camera, canvas);
    controls.enableRotate = !view.flat;
    controls.listenToKeyEvents(canvas);

    function aim() {
      camera.position.copy(middle).addScaledVector(away, 3 * view.size);
      camera.zoom = 1;
      controls.target.copy(middle);
      controls.update();
    }

    function draw() {
      const width = canvas.clientWidth, height = canvas.clientHeight;
      if (!width) return;
      const two = shownPanes();
      titles.replaceChildren(...(two.length > 1 ? two.map(i => make("b", {}, methods[i].label)) : []));
      const w = width / two.length, aspect = w / height;
      const tall = 1.06 * Math.max(held[1], held[0] / aspect);
      Object.assign(camera, { left: -tall * aspect, right: tall * aspect, top: tall, bottom: -tall });
      camera.updateProjectionMatrix();
      renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
      renderer.setSize(width, height, false);
      renderer.setScissorTest(true);
      two.forEach((number, i) => {
        const p = panes[number];
        p.light.position.copy(camera.position).sub(controls.target).normalize();
        renderer.setViewport(i * w, 0, w, height);
        renderer.setScissor(i * w, 0, w - (i + 1 < two.length ? 1 : 0), height);
        renderer.render(p.scene, camera);
      });
    }

    const shownPanes = () => state.other >= 0 ? [state.method, state.other] : [state.method];

    function painted(colour) { // behind the bodies
      for (const p of panes) p.scene.background.set(colour);
      draw();
    }

    function named() { // the picture on white with what it shows: methods above, instant and colours below
      painted("#ffffff");
      const size = Math.round(canvas.width / 45), room = Math.round(1.8 * size);
      const whole = make("canvas", { width: canvas.width, height: canvas.height + 2 * room });
      const pen = whole.getContext("2d"), two = shownPanes(), [low, high] = range(state.by);
      pen.fillStyle = "#ffffff";
      pen.fillRect(0, 0, whole.width, whole.height);
      pen.drawImage(canvas, 0, room);
      const picture = canvas.toDataURL("image/png");
      painted(style("--canvas"));
      pen.fillStyle = "#000000";
      pen.font = `${size}px sans-serif`;
      const each = whole.width / two.length;
      const titles = two.map((number, i) => [methods[number].label, i * each + size / 2, 1.3 * size, each - size]);
      const words = [view.labels[state.frame], `${names.get(state.by)}: ${shown(low)} to ${shown(high)}`, view.part];
      const said = [...titles, [words.filter(Boolean).join("; "), size / 2, whole.height - 0.6 * size, whole.width - size]];
      for (const one of said) pen.fillText(...one);
      const drawing = `<svg xmlns="http://www.w3.org/2000/svg" width="${whole.width}" height="${whole.height}" font-family="sans-serif" font-size="${size}"><rect width="100%" height="100%" fill="#ffffff"/><image y="${room}" width="${canvas.width}" height="${canvas.height}" href="${picture}"/>${said.map(([text, x, y]) => written(x, y, text)).join("")}</svg>`;
      return { whole, drawing };
    }

    function update() {
      fill(panes[state.method]);
      if (state.other >= 0) fill(panes[state.other]);
      const [low, high] = range(state.by);
      const arrows = methods[state.method].markers && state.markers && state.arrows > 1 ? `arrows ${state.arrows} times as long` : "";
      legend.replaceChildren(names.get(state.by), " ", shown(low), make("span", { class: "ramp" }), shown(high),
        make("span", { class: "also" }, [arrows, view.part].filter(Boolean).join("; ")));
      output.textContent = view.labels[state.frame];
      canvas.setAttribute("aria-label", `${methods[state.method].label} at ${view.labels[state.frame]}, `
        + `coloured by ${names.get(state.by)}; drag or Shift and arrow keys turn it, arrow keys move it`);
      draw();
    }

    // Controls.
    const names = new Map([["displacement", "displacement / mm"]]);
    if (methods.some(m => m.markers)) names.set("error", "marker error / mm");
    for (const m of methods) for (const name of Object.keys(m.fields)) names.set(name, name);
    methods.forEach((m, i) => {
      if (methods.some((other, j) => j !== i && other.packed === m.packed)) names.set(`difference ${i}`, `difference from ${m.label} / mm`);
    });
    const select = (label, options, chosen, change) => {
      const one = make("select", {}, ...options.map(([value, text]) => make("option", { value: String(value) }, text)));
      one.value = String(chosen);
      one.addEventListener("change", () => { change(one.value); update(); });
      return make("label", {}, `${label} `, one);
    };
    const tick = (label, name) => {
      const one = make("input", { type: "checkbox", checked: state[name] });
      one.addEventListener("change", () => { state[name] = one.checked; update(); });
      return make("label", {}, one, ` ${label}`);
    };
    const output = make("output", {});
    const legend = make("div", { class: "legend" }), titles = make("div", { class: "titles" });
    const slider = make("input", { type: "range", min: "0", max: String(frames - 1), step: "1", "aria-label": "load or time" });
    slider.value = String(state.frame);
    slider.addEventListener("input", () => { state.frame = Number(slider.value); update(); });
    const again = make("button", { type: "button" }, "Reset view");
    again.addEventListener("click", () => { aim(); draw(); });
    const save = make("button", { type: "button" }, "Save PNG");
    save.addEventListener("click", () => {
      make("a", { href: named().whole.toDataURL("image/png"), download: `${document.title}.png` }).click();
    });
    const drawn = make("button", { type: "button" }, "Save SVG");
    drawn.addEventListener("click", () => saved(document.title, named().drawing));
    const labels = methods.map((m, i) => [i, m.label]);
    const row = make("div", { class: "controls" });
    if (frames > 1) row.append(make("label", {}, "Load or time "), slider, output);
    else row.append(output);
    const choice = make("div", { class: "controls" }), more = make("div", { class: "controls" });
    const colours = select("Colour", [...names], state.by, v => { state.by = v; }), by = colours.querySelector("select");
    if (methods.length > 1) {
      const beside = select("beside", [[-1, "none"], ...labels], -1, v => { state.other = Number(v); });
      const others = beside.querySelector("select");
      const apart = () => { // a method stands neither beside itself nor differs from itself, or on another mesh
        const out = (option, gone) => { option.hidden = option.disabled = gone; };
        for (const option of others.options) out(option, option.value === String(state.method));
        if (state.other === state.method) others.value = String(state.other = -1);
        for (const option of by.options) {
          const other = option.value.startsWith("difference ") && methods[Number(option.value.slice(11))];
          out(option, Boolean(other) && (other === methods[state.method] || other.packed !== methods[state.method].packed));
        }
        if (by.selectedOptions[0].disabled) by.value = state.by = "displacement";
      };
      choice.append(select("Method", labels, 0, v => { state.method = Number(v); apart(); }), beside);
      apart();
    }
    choice.append(colours);
    more.append(select("Displacements", [[1, "true"], [2, "2 times"], [5, "5 times"], [10, "10 times"], [0, "none"]], 1,
      v => { state.scale = Number(v); }));
    if (methods.some(m => m.markers)) {
      more.append(tick("measured markers", "markers"), select("Arrows", [[1, "true"], [2, "2 times"], [5, "5 times"],
        [10, "10 times"], [0, "none"]], state.arrows, v => { state.arrows = Number(v); }));
    }
    if (methods.some(m => m.outlines)) more.append(tick("outlines", "outline"));
    if (methods.some(m => m.probes)) more.append(tick("probes", "probes"));
    if (view.cut) more.append(tick("cut open", "cut"));
    if (!view.flat) more.append(tick("see through", "through"));
    more.append(tick("mesh edges", "edges"), again, save, drawn);
    const words = ["Black: measured; orange arrows point to it from the simulated place. Grey: plates and tools."];
    if (!methods.some(m => m.markers || m.outlines)) words[0] = "The body as simulated.";
    if (methods.some(m => m.outlines)) words.push("Black line: measured outline; blue: simulated.");
    if (methods.some(m => m.probes)) words.push("White: probes of the simulation.");
    if (view.left_out.length) words.push(`Not in this view: ${view.left_out.join(", ")}.`);
    const text = make("figcaption", {}, words.join(" "));
    const viewer = make("div", { class: "viewer" }, titles, canvas, legend, row, choice,
      make("details", {}, make("summary", {}, "More of the view"), more, text));
    figure.prepend(viewer);
    const stills = figure.querySelector(".stills");
    if (stills) {
      stills.open = false;
      addEventListener("beforeprint", () => { stills.open = true; });
    }
    controls.addEventListener("change", draw);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => painted(style("--canvas")));
    new ResizeObserver(draw).observe(canvas);
    aim();
    update();
  }

  // --- all of it, each figure once it has a width ------------------------------------------------

  for (const one of document.querySelectorAll("table.sortable")) table(one);
  for (const one of document.querySelectorAll(".series")) series(one);
  for (const one of document.querySelectorAll("figure")) {
    if (!one.querySelector("script.plot, script.view")) saver(one);
  }
  const builders = { plot: curves, view: body };
  const waiting = new Set(document.querySelectorAll("script.plot, script.view"));
  const build = () => {
    for (const script of waiting) {
      const figure = script.closest("figure");
      if (!figure.clientWidth) continue; // in a closed section
      waiting.delete(script);
      builders[script.className](figure, script);
    }
  };
  for (const section of document.querySelectorAll("main details")) section.addEventListener("toggle", build);
  build();
  open();
})();
