// What a page shows and sends: messages come over a line as {name: value}, each shown by the function of its name in
// `show`; what its reader does goes back as [verb, value, ...].
(() => {
  const COLORS = { none: "#ffffff", unstable: "#d8dee9", stable: "#56b4e9", here: "#d55e00", curve: "#0072b2", ink: "#2e3440" };
  const FRAME = 1000 / 12;  // between two pictures of a flight, ms
  const at = id => document.getElementById(id);
  const line = new WebSocket(`${location.protocol.replace("http", "ws")}//${location.host}/ws${location.search}`);
  const send = (...words) => line.readyState === WebSocket.OPEN && line.send(JSON.stringify(words));

  // Elements of the page and of its charts
  const grow = (parent, tag, values = {}, text = null) => {
    const made = parent instanceof SVGElement ? document.createElementNS("http://www.w3.org/2000/svg", tag) : document.createElement(tag);
    for (const [key, value] of Object.entries(values)) made.setAttribute(key, value);
    if (text !== null) made.textContent = text;
    return parent.appendChild(made);
  };
  const table = (id, rows, notes = []) => {
    at(id).replaceChildren();
    const body = grow(at(id), "table");
    rows.forEach((row, k) => row.reduce((to, text) => (grow(to, k ? "td" : "th", {}, text), to), grow(body, "tr")));
    for (const note of notes) grow(at(id), "p", {}, note);
  };

  // A chart: axes about a plane whose coordinates the others draw in
  class Chart {
    constructor(id, width, height, across, upwards) {
      Object.assign(this, { svg: at(id), width, height, across, upwards });
      this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
      [this.axes, this.plane] = ["g", "g"].map(tag => grow(this.svg, tag));
      this.range([0, 1], [0, 1]);
    }
    range(x, y) {
      Object.assign(this, { x, y, left: 62, right: this.width - 14, top: 6, bottom: this.height - 34 });
      const frame = { x: this.left, y: this.top, width: this.right - this.left, height: this.bottom - this.top };
      this.axes.replaceChildren();
      const clip = grow(grow(this.axes, "clipPath", { id: `${this.svg.id}_clip` }), "rect", frame);
      this.plane.setAttribute("clip-path", `url(#${clip.parentNode.id})`);
      grow(this.axes, "rect", { ...frame, fill: "none", stroke: "#8390a8" });
      for (const value of this.ticks(x)) {
        grow(this.axes, "line", { x1: this.px(value), x2: this.px(value), y1: this.bottom, y2: this.bottom + 4, stroke: "#8390a8" });
        grow(this.axes, "text", { x: this.px(value), y: this.bottom + 15, "text-anchor": "middle" }, value);
      }
      for (const value of this.ticks(y)) {
        grow(this.axes, "line", { x1: this.left - 4, x2: this.left, y1: this.py(value), y2: this.py(value), stroke: "#8390a8" });
        grow(this.axes, "text", { x: this.left - 6, y: this.py(value) + 4, "text-anchor": "end" }, value);
      }
      grow(this.axes, "text", { x: (this.left + this.right) / 2, y: this.height - 4, "text-anchor": "middle" }, this.across);
      const middle = (this.top + this.bottom) / 2;
      grow(this.axes, "text", { x: 10, y: middle, "text-anchor": "middle", transform: `rotate(-90 10 ${middle})` }, this.upwards);
    }
    ticks([low, high]) {
      const power = 10 ** Math.floor(Math.log10((high - low) / 5));
      const step = power * [1, 2, 5, 10].find(times => (high - low) / (times * power) <= 6);
      const first = Math.ceil(low / step - 1e-9);
      const count = Math.floor(high / step + 1e-9) - first + 1;
      return Array.from({ length: count }, (_, k) => +((first + k) * step).toPrecision(10));
    }
    px(x) { return this.left + (x - this.x[0]) / (this.x[1] - this.x[0]) * (this.right - this.left); }
    py(y) { return this.bottom - (y - this.y[0]) / (this.y[1] - this.y[0]) * (this.bottom - this.top); }
    path(points) { return points.map(([x, y], k) => `${k ? "L" : "M"}${this.px(x).toFixed(2)} ${this.py(y).toFixed(2)}`).join(""); }
    under(event) {  // the place of a pointer
      const place = new DOMPoint(event.clientX, event.clientY).matrixTransform(this.svg.getScreenCTM().inverse());
      return [this.x[0] + (place.x - this.left) / (this.right - this.left) * (this.x[1] - this.x[0]),
        this.y[0] + (this.bottom - place.y) / (this.bottom - this.top) * (this.y[1] - this.y[0])];
    }
  }
  const map = new Chart("map", 420, 300, "Frequency (Hz)", "");
  const side = new Chart("side", 348, 378, "x (mm)", "z (mm)");
  const running = { height: new Chart("height", 420, 150, "Time (s)", "Height (mm)"), tilt: new Chart("tilt", 420, 150, "Time (s)", "Polar angle (°)") };
  const regions = grow(map.plane, "image", { preserveAspectRatio: "none" });
  const here = grow(map.plane, "circle", { r: 6, fill: COLORS.here, stroke: "white" });
  const bodies = grow(side.plane, "g"), crosses = grow(side.plane, "path", { stroke: COLORS.ink, "stroke-width": 2 });
  const ball = grow(side.plane, "circle", { id: "ball", fill: "#9aa5b1", "fill-opacity": 0.6, stroke: COLORS.here });
  const curves = Object.fromEntries(Object.entries(running).map(([key, chart]) =>
    [key, grow(chart.plane, "path", { fill: "none", stroke: COLORS.curve, "stroke-width": 1.5 })]));
  let point = [0, 0], places = [], ghost = null, drawn = null, held = false, samples = [[], [], []], playing = false, asked = false, last = 0;
  let pose = { position: [0, 0, -20], moment: [0, 0, 1], seen: [0, 0, -20], angle: 0 };

  const drawHere = () => { here.setAttribute("cx", map.px(point[0])); here.setAttribute("cy", map.py(point[1])); };
  const drawBall = ([x, , z]) => {
    if (!drawn) return;
    const low = Math.min(-60, z - 2 * drawn.radius), half = 34 * (15 - low) / 75;  // of one scale
    if (side.y[0] !== low) { side.range([-half, half], [low, 15]); drawSide(); }
    for (const [key, value] of Object.entries({ cx: side.px(x), cy: side.py(z), r: side.px(drawn.radius) - side.px(0) })) ball.setAttribute(key, value);
    ball.place = [x, z];
  };
  const drawSide = () => {
    bodies.replaceChildren();
    for (const { at: corners, faces, color, opacity } of [...drawn.turning, ...drawn.fixed]) {
      const flat = faces.map(face => face.map(k => [corners[k][0], corners[k][2]]))
        .map(([a, b, c]) => (b[0] - a[0]) * (c[1] - a[1]) < (b[1] - a[1]) * (c[0] - a[0]) ? [a, c, b] : [a, b, c]);  // else front and back are a hole
      grow(bodies, "path", { d: flat.map(face => `${side.path(face)}Z`).join(""), fill: color, stroke: color, "stroke-width": 0.5, opacity });
    }
    if (ghost) grow(bodies, "circle", { cx: side.px(ghost[0]), cy: side.py(ghost[2]), r: side.px(drawn.radius) - side.px(0), fill: "none", stroke: "#6b7689", "stroke-dasharray": "4 3" });
    crosses.setAttribute("d", places.map(([x, z]) => [[-1, -1], [1, 1], [-1, 1], [1, -1]]
      .map(([a, b], k) => `${k % 2 ? "L" : "M"}${side.px(x) + 4 * a} ${side.py(z) + 4 * b}`).join("")).join(""));
  };
  const drawCurves = () => ["height", "tilt"].forEach((key, k) => {
    const [time, values] = [samples[0], samples[k + 1]];
    if (!time.length) { curves[key].setAttribute("d", ""); return; }
    const low = Math.min(...values), high = Math.max(...values), room = Math.max(0.05 * (high - low), 0.01);
    running[key].range([time[0], Math.max(time[time.length - 1], time[0] + 1e-3)], [low - room, high + room]);
    curves[key].setAttribute("d", running[key].path(time.map((t, n) => [t, values[n]])));
  });

  // The picture that turns with the mouse, by Plotly
  const turned = (points, angle) => {
    const c = Math.cos(angle), s = Math.sin(angle);
    return points.map(([x, y, z]) => [c * x - s * y, s * x + c * y, z]);
  };
  // Turns z into the moment (Rodrigues), then moves to the position.
  const moved = (points, position, [u, v, w]) => points.map(([x, y, z]) => {
    if (w < -1 + 1e-9) return [position[0] + x, position[1] - y, position[2] - z];
    const k = (v * x - u * y) / (1 + w);
    return [position[0] + w * x + u * z + k * v, position[1] + w * y + v * z - k * u, position[2] + w * z - u * x - v * y];
  });
  const column = (points, k) => points.map(one => one[k]);
  const xyz = points => ({ x: column(points, 0), y: column(points, 1), z: column(points, 2), hoverinfo: "skip" });
  const mesh = (body, points) => ({
    type: "mesh3d", ...xyz(points), i: column(body.faces, 0), j: column(body.faces, 1), k: column(body.faces, 2),
    color: body.color, opacity: body.opacity, flatshading: body.faces.length < 20,
    lighting: { ambient: 0.65, diffuse: 0.6, specular: 0.2, roughness: 0.6 },
  });
  const strokes = (lines, color, width) =>
    ({ type: "scatter3d", mode: "lines", ...xyz(lines.flatMap(points => [...points, [null, null, null]])), line: { color, width } });
  const axis = (low, high) => ({ range: [low, high], visible: false });
  let busy = false, again = false, took = 0, waiting = null, idle = 0;
  const draw = async () => {
    if (!drawn) return;
    if (busy) { again = true; return; }
    busy = true;
    const [half, low, high] = drawn.reach, began = performance.now(), turn = pose.flying ? 0 : idle;
    const [position, moment] = turned([pose.position, pose.moment], turn);
    await Plotly.react("picture", [
      ...drawn.turning.map(body => mesh(body, turned(body.at, pose.angle + turn))),
      strokes(drawn.lines.map(points => turned(points, pose.angle + turn)), "#5e81ac", 2),
      ...drawn.floater.map(body => mesh(body, moved(body.at, position, moment))),
      ...drawn.fixed.map(body => mesh(body, body.at)),
      strokes(drawn.edges, "#4c566a", 3),
    ], {
      margin: { l: 0, r: 0, t: 0, b: 0 }, showlegend: false, uirevision: "kept",
      scene: { aspectmode: "data", xaxis: axis(-half, half), yaxis: axis(-half, half), zaxis: axis(low, high),
        camera: { eye: { x: 0.22, y: -1.45, z: 0.28 }, center: { x: 0, y: 0, z: 0 }, projection: { type: "perspective" } } },
    }, { displaylogo: false, responsive: true, displayModeBar: false });
    await new Promise(done => requestAnimationFrame(() => setTimeout(done)));
    took = performance.now() - began;
    busy = false;
    if (again) { again = false; requestAnimationFrame(draw); }
  };
  // At rest the floater is locked to the rotor: both turn slowly together, where the browser draws fast enough.
  setInterval(() => {
    if (!drawn || pose.flying || busy || !took || took > 60 || document.hidden || at("picture").matches(":active")) return;
    idle += 0.08;
    draw();
  }, 80);
  // While a slider moves its numbers come first; a picture that takes long to draw follows when it rests.
  const drawSoon = () => { clearTimeout(waiting); waiting = setTimeout(draw, took < 40 ? 0 : 350); };

  // One piece of a flight at a time; a page that draws too slowly for its speed falls behind.
  const fly = () => {
    if (!playing || asked) return;
    const now = performance.now(), seconds = Math.min(now - last, 250) / 1000;
    [asked, last] = [true, now];
    send("fly", Math.max(seconds, 1e-3) * at("speed").value);
  };

  const choose = (id, options, value) => {
    at(id).replaceChildren();
    for (const [name, title] of Object.entries(options)) grow(at(id), "option", { value: name }, title);
    at(id).value = value;
    at(id).hidden = !Object.keys(options).length;
  };
  const slide = (name, value) => { at(name).value = value; at(name).previousSibling.textContent = +(+value).toFixed(2); };
  const millimetres = place => `${(-place[2]).toPrecision(4)} mm`;
  const save = (name, blob) => {
    const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(blob), download: name });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  };
  let copies = {};
  const texts = id => text => { at(id).textContent = text; };
  const show = {
    message: texts("message"), says: texts("says"), map_says: texts("map_says"),
    copies: found => { copies = found; at("command").textContent = found.line; at("copied").textContent = ""; },
    place: place => { at("place").textContent = place ? millimetres(place) : "–"; },
    beside: found => {
      ghost = found && found[0];
      at("beside").textContent = found ? `${found[1]}: ${millimetres(ghost)}` : "";
      if (drawn) drawSide();
    },
    controls: known => {
      at("sliders").replaceChildren();
      for (const { name, title, value, start, end, step } of known.sliders) {
        const label = grow(at("sliders"), "label", {}, title);
        grow(label, "output");
        const input = grow(label, "input", { type: "range", id: name, min: start, max: end, step });
        slide(name, value);
        input.addEventListener("input", () => { slide(name, input.value); send("move", name, +input.value); });
      }
      choose("model", known.models, known.model);
      choose("plate_model", known.plate_models, known.plate_model);
    },
    slider: ([name, value]) => slide(name, value),
    numbers: found => {
      at("headline").textContent = found.headline;
      at("sign").textContent = found.sign;
      at("sign").dataset.number = found.number;
      table("table", found.rows, found.left_out);
      table("modes", found.modes);
    },
    point: value => { point = value; drawHere(); },
    regions: found => {
      regions.setAttribute("href", "data:,");
      if (!found) return;
      const { frequencies: x, measures: y, kind } = found;
      const picture = Object.assign(document.createElement("canvas"), { width: x.length, height: y.length }), brush = picture.getContext("2d");
      kind.forEach((row, i) => row.forEach((value, j) => {
        brush.fillStyle = [COLORS.none, COLORS.unstable, COLORS.stable][value];
        brush.fillRect(i, y.length - 1 - j, 1, 1);
      }));
      map.upwards = found.title;
      map.range([x[0], x[x.length - 1]], [y[0], y[y.length - 1]]);
      const half = [x, y].map(values => (values[1] - values[0]) / 2);  // pixels are about the values
      const [left, right] = [x[0] - half[0], x[x.length - 1] + half[0]].map(value => map.px(value));
      const [bottom, top] = [y[0] - half[1], y[y.length - 1] + half[1]].map(value => map.py(value));
      const place = { href: picture.toDataURL(), x: left, y: top, width: right - left, height: bottom - top };
      for (const [key, value] of Object.entries(place)) regions.setAttribute(key, value);
      drawHere();
    },
    bodies: found => { drawn = found; drawSide(); drawSoon(); },
    equilibria: found => { places = found; if (drawn) drawSide(); },
    pose: async found => {
      pose = found;
      if (!held) drawBall(pose.seen);
      if (!found.flying) { asked &&= playing; drawSoon(); return; }
      if (found.ended) show.playing(false);
      await draw();
      if (found.piece) asked = false;  // the next one may come
      setTimeout(fly, Math.max(0, last + FRAME - performance.now()));
    },
    samples: found => {
      samples = samples.map((old, k) => (found.fresh ? found.new[k] : [...old, ...found.new[k]]).slice(-found.most));
      drawCurves();
    },
    playing: is => {
      playing = is;
      at("play").textContent = is ? "Pause" : "Play";
      last = performance.now() - FRAME;
      fly();
    },
    address: query => {
      const token = new URLSearchParams(location.search).get("token");
      history.replaceState(null, "", `${location.pathname}?token=${token}&${query}`);
    },
    file: ({ name, kind, content }) => {
      save(name, new Blob([Uint8Array.from(atob(content), letter => letter.charCodeAt(0))], { type: kind }));
    },
  };
  line.onmessage = event => { for (const [name, value] of Object.entries(JSON.parse(event.data))) show[name](value); };
  line.onclose = () => { if (!at("message").textContent) at("message").textContent = "The connection to spinlev was closed. Load the page again, or start spinlev explore again."; };

  for (const name of ["model", "plate_model"]) at(name).addEventListener("change", () => send("choose", name, at(name).value));
  for (const kind of ["toml", "json", "nc"]) at(`get_${kind}`).addEventListener("click", () => send("get", kind));
  for (const kind of ["command", "python"]) at(`copy_${kind}`).addEventListener("click", () => navigator.clipboard.writeText(copies[kind])
    .then(() => "Copied.", () => "The browser does not let pages copy.").then(texts("copied")));
  at("preset").addEventListener("change", () => { if (at("preset").value) send("preset", at("preset").value); });
  at("figure").addEventListener("click", () => {  // the charts as they are, with the text above them
    const charts = [map, side, running.height, running.tilt], whole = grow(document.createElementNS("http://www.w3.org/2000/svg", "g"), "svg");
    const places = [[10, 30], [450, 30], [10, 420], [450, 420]];
    for (const [key, value] of Object.entries({ viewBox: "0 0 880 580", width: 880, height: 580 })) whole.setAttribute(key, value);
    grow(whole, "style", {}, "text { font: 11px sans-serif; fill: #2e3440; } image { image-rendering: pixelated; }");
    grow(whole, "text", { x: 10, y: 18 }, `${at("headline").textContent} ${at("sign").textContent}`);
    charts.forEach((chart, k) => {
      const copy = whole.appendChild(chart.svg.cloneNode(true));
      for (const [key, value] of Object.entries({ x: places[k][0], y: places[k][1], width: chart.width, height: chart.height })) copy.setAttribute(key, value);
    });
    save("explore.svg", new Blob([new XMLSerializer().serializeToString(whole)], { type: "image/svg+xml" }));
  });
  at("play").addEventListener("click", () => show.playing(!playing));
  at("reset").addEventListener("click", () => { show.playing(false); send("reset"); });
  at("up").addEventListener("click", () => send("kick", 0, 0, +at("strength").value));
  at("aside").addEventListener("click", () => send("kick", +at("strength").value, 0, 0));
  at("file").addEventListener("change", async () => {
    const [file] = at("file").files, reader = new FileReader();
    reader.onload = () => send("open", file.name, reader.result.split(",")[1] || "");
    if (file) reader.readAsDataURL(file.slice(0, 300000));  // more than is taken
  });
  at("map").addEventListener("click", event => regions.getAttribute("href") !== "data:," && send("go", ...map.under(event)));
  ball.addEventListener("pointerdown", event => { held = true; ball.setPointerCapture(event.pointerId); show.playing(false); event.preventDefault(); });
  ball.addEventListener("pointermove", event => { if (held) { const [x, z] = side.under(event); drawBall([x, 0, z]); } });
  ball.addEventListener("pointercancel", () => { held = false; });
  ball.addEventListener("pointerup", () => { if (held) { held = false; send("put", ...ball.place); } });
})();
