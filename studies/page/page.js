// What Bokeh's widgets cannot do: the picture that turns with the mouse (by Plotly), the address, and files to keep.
window.spinlev = (() => {
  const LOOK = {
    margin: { l: 0, r: 0, t: 0, b: 0 }, showlegend: false, uirevision: "kept",
    scene: { aspectmode: "data", camera: { eye: { x: 0.22, y: -1.45, z: 0.28 }, center: { x: 0, y: 0, z: 0 }, projection: { type: "perspective" } } },
  };
  const WAYS = { displaylogo: false, responsive: true, displayModeBar: false };
  let drawn = null, pose = { position: [0, 0, -20], moment: [0, 0, 1], angle: 0 }, busy = false, again = false, took = 0;

  const turned = (at, angle) => {
    const c = Math.cos(angle), s = Math.sin(angle);
    return at.map(([x, y, z]) => [c * x - s * y, s * x + c * y, z]);
  };
  // Turns z into the moment (Rodrigues), then moves to the position.
  const carried = (at, position, [u, v, w]) => at.map(([x, y, z]) => {
    if (w < -1 + 1e-9) return [position[0] + x, position[1] - y, position[2] - z];
    const k = (v * x - u * y) / (1 + w);
    return [position[0] + w * x + u * z + k * v, position[1] + w * y + v * z - k * u, position[2] + w * z - u * x - v * y];
  });
  const column = (at, k) => at.map(point => point[k]);
  const places = at => ({ x: column(at, 0), y: column(at, 1), z: column(at, 2) });
  const mesh = (body, at) => ({
    type: "mesh3d", ...places(at), i: column(body.faces, 0), j: column(body.faces, 1), k: column(body.faces, 2),
    color: body.color, opacity: body.opacity, flatshading: body.faces.length < 20, hoverinfo: "skip",
    lighting: { ambient: 0.65, diffuse: 0.6, specular: 0.2, roughness: 0.6 },
  });
  const line = (lines, color, width) => ({
    type: "scatter3d", mode: "lines", ...places(lines.flatMap(points => [...points, [null, null, null]])),
    line: { color, width }, hoverinfo: "skip",
  });
  const traces = () => [
    ...drawn.turning.map(body => mesh(body, turned(body.at, pose.angle))),
    line(drawn.lines.map(points => turned(points, pose.angle)), "#5e81ac", 2),
    ...drawn.floater.map(body => mesh(body, carried(body.at, pose.position, pose.moment))),
    ...drawn.fixed.map(body => mesh(body, body.at)),
    line(drawn.edges, "#4c566a", 3),
  ];
  const axis = (low, high) => ({ range: [low, high], visible: false });
  const draw = async () => {
    if (!drawn) return;
    if (busy) { again = true; return; }
    busy = true;
    const [half, low, high] = drawn.reach;
    const scene = { ...LOOK.scene, xaxis: axis(-half, half), yaxis: axis(-half, half), zaxis: axis(low, high) };
    const began = performance.now();
    await Plotly.react("picture", traces(), { ...LOOK, scene }, WAYS);
    await new Promise(done => requestAnimationFrame(() => setTimeout(done)));
    took = performance.now() - began;
    busy = false;
    if (again) { again = false; requestAnimationFrame(draw); }
  };
  // While a slider moves its numbers come first; a picture that takes long to draw follows when it rests.
  let waiting = null;
  const drawSoon = () => { clearTimeout(waiting); waiting = setTimeout(draw, took < 40 ? 0 : 350); };
  return {
    bodies: text => { drawn = JSON.parse(text); drawSoon(); },
    pose: async (text, line) => {
      pose = JSON.parse(text);
      if (!pose.flying) { drawSoon(); return; }
      await draw();
      requestAnimationFrame(() => { line.text = `${performance.now()}`; });  // then the next one may come
    },
    address: text => {
      const query = JSON.parse(text);
      const token = new URLSearchParams(location.search).get("token");
      history.replaceState(null, "", `${location.pathname}?token=${token}&${query}`);
    },
    file: text => {
      const { name, kind, content } = JSON.parse(text);
      const bytes = Uint8Array.from(atob(content), letter => letter.charCodeAt(0));
      const link = document.createElement("a");
      link.href = URL.createObjectURL(new Blob([bytes], { type: kind }));
      link.download = name;
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 10000);
    },
  };
})();
