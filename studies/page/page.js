// What a page shows and sends: messages come over a line as {name: value}, each shown by the function of its name in
// `show`; what its reader does goes back as [verb, value, ...].
(() => {
  const COLORS = { stable: "#56b4e9", dipole: "#6b7689", north: "#d55e00", curve: "#0072b2", ink: "#2e3440", ball: "#9aa5b1", line: "#5e81ac" };
  const FRAME = 1000 / 20;  // between two pictures, ms
  const TURN = 6;  // of the rotor at rest, s
  const SILENCE = 1500;  // after which a computation is said to go on, ms
  const VIRIDIS = ["#440154", "#3b528b", "#21918c", "#5ec962", "#fde725"];  // of |B| by decades
  const at = id => document.getElementById(id);
  const line = new WebSocket(`${location.protocol.replace("http", "ws")}//${location.host}/ws${location.search}`);
  const send = (...words) => {
    if (line.readyState !== WebSocket.OPEN) return;
    line.send(JSON.stringify(words));
    if (["move", "choose", "open", "preset", "go"].includes(words[0])) pending = performance.now();
  };

  // Elements of the page and of its charts
  const say = (id, text) => { at(id).textContent = text; };
  const set = (element, values) => { for (const [key, value] of Object.entries(values)) element.setAttribute(key, value); };
  const grow = (parent, tag, values = {}, text = null) => {
    const made = parent instanceof SVGElement ? document.createElementNS("http://www.w3.org/2000/svg", tag) : document.createElement(tag);
    set(made, values);
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
      const tick = (value, x1, x2, y1, y2, x, y, anchor) => {
        grow(this.axes, "line", { x1, x2, y1, y2, stroke: "#8390a8" });
        grow(this.axes, "text", { x, y, "text-anchor": anchor }, value);
      };
      const { left, bottom } = this;
      for (const [value, p] of this.ticks(x).map(one => [one, this.px(one)])) tick(value, p, p, bottom, bottom + 4, p, bottom + 15, "middle");
      for (const [value, p] of this.ticks(y).map(one => [one, this.py(one)])) tick(value, left - 4, left, p, p, left - 6, p + 4, "end");
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
  const stable = grow(map.plane, "path", { fill: COLORS.stable });
  const border = grow(map.plane, "path", { fill: "none", stroke: COLORS.dipole, "stroke-width": 1.8 });
  const article = grow(map.svg, "g"), here = grow(map.svg, "circle", { r: 6, fill: COLORS.north, stroke: "white" });
  const slice = grow(side.plane, "image", { preserveAspectRatio: "none", opacity: 0.6 });
  const bodies = grow(side.plane, "g"), crosses = grow(side.plane, "path", { stroke: COLORS.ink, "stroke-width": 2 });
  const shape = grow(side.plane, "path", { id: "shape", fill: COLORS.ball, "fill-opacity": 0.95, stroke: COLORS.ball, "stroke-width": 0.5 });
  const ball = grow(side.plane, "circle", { id: "ball", class: "ball", fill: COLORS.ball, "fill-opacity": 0.75, stroke: COLORS.north });
  const curves = Object.fromEntries(Object.entries(running).map(([key, chart]) =>
    [key, grow(chart.plane, "path", { fill: "none", stroke: COLORS.curve, "stroke-width": 1.5 })]));
  let point = [0, 0], places = [], ghost = null, drawn = null, field = null, held = false, samples = [[], [], []];
  let playing = false, asked = false, last = 0, pending = 0;  // `last`, `pending`: since when a piece or the answer is waited for
  let pose = { position: [0, 0, -20], moment: [0, 0, 1], seen: [0, 0, -20], angle: 0, plate: 0 };

  const drawHere = () => set(here, { cx: map.px(point[0]), cy: map.py(point[1]) });
  const drawBall = ([x, , z]) => {
    if (!drawn) return;
    const low = Math.min(-60, z - 2 * drawn.radius), half = 34 * (15 - low) / 75;  // of one scale
    if (side.y[0] !== low) { side.range([-half, half], [low, 15]); drawSide(); }
    set(ball, { cx: side.px(x), cy: side.py(z), r: side.px(drawn.radius) - side.px(0) });
    ball.place = [x, z];
    const [moment] = turned([pose.moment], pose.flying ? -pose.angle : 0);
    shape.setAttribute("d", drawn.floater.map(body => outline(body.faces, moved(body.at, [x, 0, z], moment))).join(""));
    ball.setAttribute("fill-opacity", drawn.floater.length ? 0.1 : 0.75);  // about another body, to take it by
  };
  // Faces from the side, all turned one way: else front and back are a hole.
  const outline = (faces, corners) => faces.map(face => face.map(k => [corners[k][0], corners[k][2]]))
    .map(([a, b, c]) => (b[0] - a[0]) * (c[1] - a[1]) < (b[1] - a[1]) * (c[0] - a[0]) ? [a, c, b] : [a, b, c])
    .map(face => `${side.path(face)}Z`).join("");
  const drawSide = () => {
    bodies.replaceChildren();
    const sunk = drawn.fixed.map(body => ({ ...body, at: body.at.map(([x, y, z]) => [x, y, z - pose.plate]) }));
    for (const { at: corners, faces, color, opacity } of [...drawn.turning, ...sunk]) {
      grow(bodies, "path", { d: outline(faces, corners), fill: color, stroke: color, "stroke-width": 0.5, opacity });
    }
    for (const [[x, , z], [u, , w]] of drawn.arrows) {
      const head = [[1, 0], [0.45, 0.2], [0.45, 0.07], [-1, 0.07], [-1, -0.07], [0.45, -0.07], [0.45, -0.2]];
      grow(bodies, "path", { d: `${side.path(head.map(([a, b]) => [x + a * u - b * w, z + a * w + b * u]))}Z`, fill: COLORS.north });
    }
    const [from, to] = [[0, side.y[0]], [0, side.y[1]]].map(([x, z]) => [side.px(x), side.py(z)]);
    grow(grow(bodies, "line", { x1: from[0], y1: from[1], x2: to[0], y2: to[1], stroke: COLORS.ink, "stroke-width": 0.8, "stroke-dasharray": "9 3 2 3" }), "title", {}, "Axis of rotation");
    if (ghost) grow(bodies, "circle", { cx: side.px(ghost[0]), cy: side.py(ghost[2]), r: side.px(drawn.radius) - side.px(0), fill: "none", stroke: COLORS.dipole, "stroke-width": 1.5, "stroke-dasharray": "4 3" });
    if (field) set(slice, { href: field.url, x: side.px(field.x[0]), y: side.py(field.z[1]),
      width: side.px(field.x[1]) - side.px(field.x[0]), height: side.py(field.z[0]) - side.py(field.z[1]) });
    crosses.setAttribute("d", places.map(([x, z]) => [[-1, -1], [1, 1], [-1, 1], [1, -1]]
      .map(([a, b], k) => `${k % 2 ? "L" : "M"}${side.px(x) + 4 * a} ${side.py(z) + 4 * b}`).join("")).join(""));
  };
  const drawCurves = () => ["height", "tilt"].forEach((key, k) => {
    const [time, values] = [samples[0], samples[k + 1]];
    at(key).style.display = time.length > 1 ? "" : "none";
    if (time.length < 2) return;
    const low = Math.min(...values), high = Math.max(...values), room = Math.max(0.05 * (high - low), 0.01);
    running[key].range([time[0], Math.max(time[time.length - 1], time[0] + 1e-3)], [low - room, high + room]);
    curves[key].setAttribute("d", running[key].path(time.map((t, n) => [t, values[n]])));
  });

  // The picture that turns with the mouse: seen from far away, so that a ball is round and the scale is one everywhere
  const view = { yaw: 0.35, pitch: 0.2, angle: 0 }, brush = at("picture").getContext("2d");
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
  const seen = ([x, y, z]) => {  // to the right, upwards, and towards the reader
    const c = Math.cos(view.yaw), s = Math.sin(view.yaw), far = c * y - s * x;
    return [c * x + s * y, z * Math.cos(view.pitch) + far * Math.sin(view.pitch), z * Math.sin(view.pitch) - far * Math.cos(view.pitch)];
  };
  const shade = (color, light) => `rgb(${[1, 3, 5].map(k => Math.min(255, parseInt(color.slice(k, k + 2), 16) * light)).join()})`;
  const draw = () => {
    const canvas = at("picture"), ratio = devicePixelRatio || 1, [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (!drawn || !width) return;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
    const [half, low, high] = drawn.reach, angle = pose.angle + (pose.flying ? 0 : view.angle);
    const k = Math.min(width / (2 * half), height / (high - low + 6)), pieces = [];
    const px = ([u, s]) => [width / 2 + k * u, height / 2 + k * ((high + low) / 2 * Math.cos(view.pitch) - s)];
    const path = points => { brush.beginPath(); points.forEach((one, n) => brush[n ? "lineTo" : "moveTo"](...px(one))); };
    const stroke = (points, color, thick) => { path(points.map(seen)); [brush.strokeStyle, brush.lineWidth] = [color, thick]; brush.stroke(); };
    const later = (depth, paint) => pieces.push([depth, paint]);
    const solid = (body, points) => {
      const there = points.map(seen);
      for (const face of body.faces) {
        const [a, b, c] = face.map(n => there[n]), [p, q] = [0, 1].map(n => [b, c].map(one => one.map((value, m) => value - a[m]))[n]);
        const normal = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
        if (normal[2] <= 0) continue;  // its back
        const light = 0.75 + 0.45 * (-0.4 * normal[0] + 0.7 * normal[1] + 0.6 * normal[2]) / Math.hypot(...normal);
        later((a[2] + b[2] + c[2]) / 3, () => {
          path([a, b, c]); brush.closePath(); brush.globalAlpha = body.opacity; brush.fillStyle = brush.strokeStyle = shade(body.color, light);
          brush.fill(); brush.lineWidth = 0.7; if (body.opacity === 1) brush.stroke(); brush.globalAlpha = 1;
        });
      }
    };
    const arrow = (center, half, from = -1) => {  // its shaft in pieces, which bodies hide one by one
      const place = part => center.map((value, n) => value + part * half[n]), size = Math.hypot(...half);
      for (let part = from; part < 0.45; part += 0.145) later(seen(place(part + 0.07))[2], () => stroke([place(part), place(Math.min(part + 0.16, 0.5))], COLORS.north, 0.14 * size * k));
      later(seen(place(0.75))[2], () => {
        const [tip, neck] = [seen(place(1)), seen(place(0.45))], long = Math.hypot(tip[0] - neck[0], tip[1] - neck[1]) || 1;
        const across = [(neck[1] - tip[1]) / long, (tip[0] - neck[0]) / long].map(value => 0.2 * size * value);
        path([tip, [neck[0] + across[0], neck[1] + across[1]], [neck[0] - across[0], neck[1] - across[1]]]); brush.fillStyle = COLORS.north; brush.fill();
      });
    };
    brush.setTransform(ratio, 0, 0, ratio, 0, 0);
    brush.clearRect(0, 0, width, height);
    drawn.fixed.forEach(body => solid(body, body.at.map(([x, y, z]) => [x, y, z - pose.plate])));
    pieces.splice(0).sort(([a], [b]) => a - b).forEach(([, paint]) => paint());  // the plate is behind all
    if (field) {
      const [corner, right, down] = [[field.x[0], 0, field.z[1]], [field.x[1], 0, field.z[1]], [field.x[0], 0, field.z[0]]].map(one => px(seen(turned([one], angle)[0])));
      brush.save(); brush.globalAlpha = 0.5;
      brush.transform((right[0] - corner[0]) / field.image.width, (right[1] - corner[1]) / field.image.width, (down[0] - corner[0]) / field.image.height, (down[1] - corner[1]) / field.image.height, ...corner);
      brush.drawImage(field.image, 0, 0); brush.restore();
    }
    const [position, moment] = turned([pose.position, pose.moment], pose.flying ? 0 : angle), r = drawn.radius;
    for (const body of drawn.turning) solid(body, turned(body.at, angle));
    for (const ends of drawn.arrows) arrow(...turned(ends, angle));
    for (const points of drawn.lines) turned(points, angle).reduce((a, b) => (later(seen(a)[2], () => stroke([a, b], COLORS.line, 1.2)), b));
    for (const body of drawn.floater) solid(body, moved(body.at, position, moment));
    if (!drawn.floater.length) later(seen(position)[2], () => {
      const [x, y] = px(seen(position)), shine = brush.createRadialGradient(x - 0.4 * r * k, y - 0.45 * r * k, 0.1 * r * k, x, y, r * k);
      [[0, 1.35], [0.5, 1], [1, 0.55]].forEach(([where, light]) => shine.addColorStop(where, shade(COLORS.ball, light)));
      brush.beginPath(); brush.arc(x, y, r * k, 0, 2 * Math.PI); brush.fillStyle = shine; brush.fill();
    });
    const up = moment.map(value => 1.5 * r * value);
    if (drawn.floater.length) arrow(position, up); else {
      arrow(position, up, 0.66);
      later(seen(position.map((value, n) => value - 0.83 * up[n]))[2], () => stroke([position.map((value, n) => value - up[n]), position.map((value, n) => value - 0.66 * up[n])], COLORS.north, 0.21 * r * k));
    }
    for (let z = low; z < high; z += 4) {  // the axis, dashed; not in the ball
      if (Math.hypot(position[0], position[1], position[2] - z - 1.5) > r) later(seen([0, 0, z])[2], () => stroke([[0, 0, z], [0, 0, z + 3]], COLORS.ink, 1));
    }
    const ring = Array.from({ length: 41 }, (_, n) => [5 * Math.cos(n / 40 * 5.2 - 2.2), 5 * Math.sin(n / 40 * 5.2 - 2.2), high - 5]);
    later(0, () => {
      stroke(ring, COLORS.ink, 1.5);
      const [tip, before] = [ring[40], ring[36]].map(one => px(seen(one))), way = Math.atan2(tip[1] - before[1], tip[0] - before[0]);
      brush.beginPath(); [[7, 0], [-3, 4], [-3, -4]].forEach(([a, b], n) => brush[n ? "lineTo" : "moveTo"](tip[0] + a * Math.cos(way) - b * Math.sin(way), tip[1] + a * Math.sin(way) + b * Math.cos(way)));
      brush.fillStyle = COLORS.ink; brush.fill();
    });
    pieces.sort(([a], [b]) => a - b).forEach(([, paint]) => paint());
    brush.fillStyle = COLORS.ink; brush.font = "12px system-ui, sans-serif";
    [brush.strokeStyle, brush.lineWidth] = ["white", 3];
    for (const kind of ["strokeText", "fillText"]) brush[kind]("axis of rotation", ...px(seen([0, 0, high - 4])).map((value, n) => value + 6 * k * !n));
    if (ghost && !pose.flying && k * Math.hypot(...ghost.map((value, n) => value - pose.position[n])) > 1.5) {
      const [x, y] = px(seen(turned([ghost], angle)[0]));
      brush.beginPath(); brush.arc(x, y, r * k, 0, 2 * Math.PI); brush.strokeStyle = COLORS.dipole; brush.lineWidth = 1.5; brush.setLineDash([4, 3]); brush.stroke(); brush.setLineDash([]);
    }
    brush.fillRect(10, height - 12, 10 * k, 3); brush.fillText("10 mm", 10, height - 17);
  };
  // At rest the floater is locked to the rotor: both turn slowly together.
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
  let before = 0;
  const animate = now => {
    if (now - before >= FRAME) {
      if (!pose.flying && !still) view.angle += Math.min(now - before, 200) / 1000 * 2 * Math.PI / TURN;
      before = now;
      draw();
    }
    requestAnimationFrame(animate);
  };
  requestAnimationFrame(animate);
  at("picture").addEventListener("pointermove", event => {
    if (!event.buttons) return;
    view.yaw -= event.movementX / 120;
    view.pitch = Math.max(-0.3, Math.min(1.4, view.pitch + event.movementY / 120));
  });

  // One piece of a flight at a time; a page that draws too slowly for its speed falls behind.
  const fly = () => {
    if (!playing || asked) return;
    const now = performance.now(), seconds = Math.min(now - last, 250) / 1000;
    [asked, last] = [true, now];
    send("fly", Math.max(seconds, 1e-3) * at("speed").value);
  };
  // Nothing that takes long goes on without a word.
  const since = start => `${Math.round((performance.now() - start) / 1000)} s`;
  setInterval(() => {
    if (asked && performance.now() - last > SILENCE) say("says", `The next piece of the trajectory is being computed (${since(last)}) ...`);
    if (pending && performance.now() - pending > SILENCE) say("sign", `${at("sign").dataset.text} The selected models are being computed (${since(pending)}) ...`);
  }, 500);

  const choose = (id, options, value) => {
    at(id).replaceChildren();
    for (const [name, title] of Object.entries(options)) grow(at(id), "option", { value: name }, title);
    at(id).value = value;
    at(id).hidden = !Object.keys(options).length;
  };
  const slide = (name, value) => { at(name).value = value; at(name).previousSibling.textContent = +(+value).toFixed(2); };
  const loaded = id => at(id).classList.remove("loading");
  const save = (name, blob) => {
    const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(blob), download: name });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  };
  let copies = {};
  const show = {
    message: text => { say("message", text); if (text) pending = 0; },
    says: text => say("says", text), map_says: text => say("map_says", text),
    copies: found => { copies = found; say("command", found.line); say("copied", ""); },
    controls: known => {
      at("sliders").replaceChildren();
      loaded("sliders");
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
      at("models").replaceChildren();
      found.models.forEach(({ name, known, pose: there, distance, polar_angle: angle, stability }, n) => {
        const cell = grow(at("models"), "div", { class: `model${n ? " beside" : ""}${known ? "" : " loading"}` });
        grow(cell, "span", {}, name);
        grow(cell, "b", {}, there ? `${distance.toPrecision(4)} mm` : known ? "–" : "00.00 mm");
        grow(cell, "span", {}, there ? `${angle.toFixed(1)}°, ${stability}` : known ? stability : "computed when you release");
      });
      ghost = found.models.find(({ name, pose: there }, n) => n && there && name === "point dipole")?.pose[0] || null;
      say("headline", found.headline);
      say("comparison", found.comparison.join(" "));
      pending = found.complete ? 0 : pending || performance.now();
      say("sign", at("sign").dataset.text = `${found.complete ? "All models under the same conditions" : "Preview"}${found.conditions && ": "}${found.conditions}.`);
      at("sign").dataset.number = found.number;
      ["table", "modes"].forEach(loaded);
      table("table", found.rows, found.left_out);
      table("modes", found.modes);
      if (drawn) drawSide();
    },
    slice: ({ x, z, pixel, strength }) => {
      const data = Uint8Array.from(atob(strength), letter => letter.charCodeAt(0)), image = document.createElement("canvas");
      [image.width, image.height] = [x, z].map(([low, high]) => Math.round((high - low) / pixel) + 1);
      const pen = image.getContext("2d"), pixels = pen.createImageData(image.width, image.height);
      const stops = VIRIDIS.map(color => [1, 3, 5].map(k => parseInt(color.slice(k, k + 2), 16)));
      data.forEach((value, n) => {
        const [row, across] = [Math.floor(n / image.width), n % image.width], part = value / 254 * (VIRIDIS.length - 1), first = Math.min(3, Math.floor(part));
        const color = [0, 1, 2].map(k => stops[first][k] + (part - first) * (stops[first + 1]?.[k] - stops[first][k]));
        pixels.data.set([...color, value === 255 ? 0 : 255], 4 * ((image.height - 1 - row) * image.width + across));
      });
      pen.putImageData(pixels, 0, 0);
      const edges = [x, z].map(([low, high]) => [low - pixel / 2, high + pixel / 2]);  // pixels are about the values
      field = { image, url: image.toDataURL(), x: edges[0], z: edges[1] };
      if (drawn) drawSide();
    },
    point: value => { point = value; drawHere(); },
    map: found => {
      [stable, border].forEach(path => path.setAttribute("d", ""));
      article.replaceChildren();
      say("map_article", "");
      at("map").classList.toggle("loading", Boolean(found));
      at("map").style.display = found ? "" : "none";
      if (!found) return;
      const { title, spans: [x, y], article: { tested, levitated, flights } } = found;
      map.upwards = title;
      map.range(x, y);
      drawHere();
      for (const value of tested.filter(one => one >= y[0] && one <= y[1])) {
        const did = levitated.includes(value), fill = did ? COLORS.ink : "white";
        grow(grow(article, "circle", { cx: map.right - 6, cy: map.py(value), r: 3.5, fill, stroke: COLORS.ink }), "title", {}, `Article, ${value}: ${did ? "levitated" : "did not levitate"}`);
      }
      for (const [frequency, value, what] of flights) {
        const mark = { x: map.px(frequency) - 4, y: map.py(value) - 4, width: 8, height: 8, fill: /^lev/.test(what) ? COLORS.ink : "white", stroke: COLORS.ink };
        grow(grow(article, "rect", mark), "title", {}, `Article, ${frequency} Hz: ${what}`);
      }
      say("map_article", `Article's experiment: rotors that levitated (●) or did not (○), on the right as it gives no frequency${flights.length ? "; squares: its trajectories, filled if they levitated" : ""}.`);
    },
    regions: ({ model, cells, border: pieces }) => {
      loaded("map");
      stable.setAttribute("d", cells.map(cell => `${map.path(cell)}Z`).join(""));
      if (model === "dipole") border.setAttribute("d", pieces.map(piece => map.path(piece)).join(""));
    },
    bodies: found => { drawn = found; loaded("side"); drawSide(); drawBall(pose.seen); },
    equilibria: found => { places = found; if (drawn) drawSide(); },
    pose: found => {
      const sunk = found.plate !== pose.plate;
      pose = found;
      if (!held) drawBall(pose.seen);
      if (drawn && sunk) drawSide();
      at("motion").textContent = found.flying ? "In real time the picture shows single instants; 1/100 and slower show the rotation."
        : `Slow motion: the rotor and the floater's moment, frequency-locked, turn once in ${TURN} s.`;
      if (!found.flying) { asked &&= playing; return; }
      if (found.ended) show.playing(false);
      if (found.piece) asked = false;  // the next one may come
      setTimeout(fly, Math.max(0, last + FRAME - performance.now()));
    },
    samples: found => {
      samples = samples.map((old, k) => (found.fresh ? found.new[k] : [...old, ...found.new[k]]).slice(-found.most));
      drawCurves();
    },
    playing: is => {
      playing = is;
      say("play", is ? "Pause" : "Play");
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
  line.onclose = () => { if (!at("message").textContent) say("message", "The connection to spinlev was closed. Load the page again, or start spinlev explore again."); };

  for (const name of ["model", "plate_model"]) at(name).addEventListener("change", () => send("choose", name, at(name).value));
  for (const kind of ["toml", "json", "nc"]) at(`get_${kind}`).addEventListener("click", () => send("get", kind));
  for (const kind of ["command", "python"]) at(`copy_${kind}`).addEventListener("click", () => navigator.clipboard.writeText(copies[kind])
    .then(() => "Copied.", () => "The browser does not let pages copy.").then(text => say("copied", text)));
  at("preset").addEventListener("change", () => { if (at("preset").value) send("preset", at("preset").value); });
  at("figure").addEventListener("click", () => {  // the charts as they are, with the text above them
    const charts = [map, side, running.height, running.tilt], whole = grow(document.createElementNS("http://www.w3.org/2000/svg", "g"), "svg");
    const places = [[10, 30], [450, 30], [10, 420], [450, 420]];
    set(whole, { viewBox: "0 0 880 580", width: 880, height: 580 });
    grow(whole, "style", {}, "text { font: 11px sans-serif; fill: #2e3440; }");
    grow(whole, "text", { x: 10, y: 18 }, `${at("headline").textContent} ${at("sign").textContent}`);
    charts.forEach((chart, k) => {
      set(whole.appendChild(chart.svg.cloneNode(true)), { x: places[k][0], y: places[k][1], width: chart.width, height: chart.height });
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
  at("map").addEventListener("click", event => send("go", ...map.under(event)));
  // The ball is taken wherever it is pressed or nearly so, as it may move on before the press is heard.
  at("side").addEventListener("pointerdown", event => {
    const [x, z] = side.under(event);
    if (!drawn || !ball.place || Math.hypot(x - ball.place[0], z - ball.place[1]) > 1.5 * drawn.radius) return;
    held = true;
    at("side").setPointerCapture(event.pointerId);
    show.playing(false);
    say("says", "Let go where the floater shall begin, at rest in the frame that turns with the rotor.");
    event.preventDefault();
  });
  at("side").addEventListener("pointermove", event => { if (held) { const [x, z] = side.under(event); drawBall([x, 0, z]); } });
  for (const kind of ["pointercancel", "pointerup", "lostpointercapture"]) at("side").addEventListener(kind, event => {
    if (!held) return;
    held = false;
    if (kind === "pointercancel") { say("says", "The browser ended the drag; nothing was changed."); drawBall(pose.seen); return; }
    say("says", `Putting the floater at x = ${ball.place[0].toFixed(1)} mm, z = ${ball.place[1].toFixed(1)} mm ...`);
    send("put", ...ball.place);
  });
  at("bar").style.background = `linear-gradient(90deg, ${VIRIDIS.join()})`;
})();
