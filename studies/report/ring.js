// Modes of a ring: sliders choose diameter and family, the wave travels. Every sector moves as the one before it, a
// phase of diameter * 2 pi / sectors later: Re(shape exp(i (phase + diameter * sector * 2 pi / sectors))), turned.
const bytes = text => Uint8Array.from(atob(text), c => c.charCodeAt(0)).buffer;

for (const controls of document.querySelectorAll(".ring")) {
  const chart = document.getElementById(controls.dataset.view);
  const meta = chart.layout.meta, count = meta.sectors;
  const rest = new Float32Array(bytes(meta.rest)), sector = new Uint16Array(bytes(meta.sector));
  const node = new Uint32Array(bytes(meta.node)), shapes = new Int16Array(bytes(meta.shapes));
  const nodes = shapes.length / 6 / meta.diameters.length, size = sector.length;
  const [diameter, family, wave, button, text] =
    ["diameter", "family", "wave", "button", "output"].map(name => controls.querySelector("." + name));
  const known = [...new Set(meta.diameters)].sort((a, b) => a - b);
  let mode = meta.mode, phase = 0, begun = null;

  const draw = () => {
    const h = meta.diameters[mode], moved = [0, 1, 2].map(() => new Float32Array(size)), far = new Float32Array(size);
    const standing = wave.value === "standing", sense = wave.value === "back" ? -1 : 1;
    const rows = [...Array(count).keys()].map(j => {
      const at = (standing ? 0 : sense * phase) + 2 * Math.PI * h * j / count;
      const swing = (standing ? Math.cos(phase) : 1) / meta.steps;
      return [swing * Math.cos(at), swing * Math.sin(at), meta.turns[j]];
    });
    for (let i = 0; i < size; i++) {
      const [cosine, sine, turn] = rows[sector[i]], first = 6 * (mode * nodes + node[i]);
      const own = [0, 2, 4].map(part => cosine * shapes[first + part] - sine * shapes[first + part + 1]);
      for (let k = 0; k < 3; k++) {
        const value = turn[3 * k] * own[0] + turn[3 * k + 1] * own[1] + turn[3 * k + 2] * own[2];
        moved[k][i] = rest[3 * i + k] + meta.scale * value;
      }
      far[i] = Math.hypot(...own);
    }
    return Plotly.restyle(chart, {x: [moved[0]], y: [moved[1]], z: [moved[2]], intensity: [far]}, [0]);
  };
  const step = now => {
    if (begun === null) return;
    phase = (now - begun) / 320;
    draw().then(() => requestAnimationFrame(step));
  };
  // the mode of the controls; of a diameter with fewer families, its last
  const choose = () => {
    const h = known[Number(diameter.value)];
    const those = [...meta.diameters.keys()].filter(m => meta.diameters[m] === h);
    mode = those[Math.min(family.selectedIndex, those.length - 1)];
    show();
  };
  const show = () => {
    diameter.value = known.indexOf(meta.diameters[mode]);
    family.selectedIndex = meta.families[mode];
    text.textContent = `${meta.names[mode]}: ${meta.frequencies[mode].toPrecision(6)} Hz`;
    if (begun === null) draw();
  };
  diameter.max = known.length - 1;
  for (let f = 0; f <= Math.max(...meta.families); f++) family.add(new Option(`family ${f + 1}`));
  diameter.addEventListener("input", choose);
  for (const control of [family, wave]) control.addEventListener("input", choose);
  button.addEventListener("click", () => {
    begun = begun === null ? performance.now() - 320 * phase : null;
    button.textContent = begun === null ? "Animate" : "Pause";
    if (begun !== null) requestAnimationFrame(step);
  });
  // a click on a mode in the interference diagram shows it
  document.getElementById(controls.dataset.diagram).on("plotly_click", event => {
    const clicked = event.points[0].customdata;
    if (Number.isInteger(clicked)) { mode = clicked; show(); }
  });
  show();
}
