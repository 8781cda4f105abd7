// Mode shapes that swing: a button below the menu moves the visible mode between its two ends.
const numbers = given => given.bdata ? new Float32Array(Uint8Array.from(atob(given.bdata), c => c.charCodeAt(0)).buffer) : given;

for (const chart of document.querySelectorAll(".plot:has(+ .swing) .js-plotly-plot")) {
  const button = chart.closest(".plot").nextElementSibling.querySelector("button");
  const rest = chart.layout.meta;
  let begun = null, moved = null;

  const step = now => {
    if (begun === null) return;
    const mode = chart.data.findIndex(trace => trace.type === "mesh3d" && trace.visible);
    if (moved === null || moved.mode !== mode) {
      settle();
      const ends = ["x", "y", "z"].map(axis => numbers(chart.data[mode][axis]));
      moved = {mode, ends};
    }
    const swing = Math.cos((now - begun) / 320);
    const at = moved.ends.map((end, axis) => [end.map((value, i) => rest[axis][i] + swing * (value - rest[axis][i]))]);
    Plotly.restyle(chart, {x: at[0], y: at[1], z: at[2]}, [mode]).then(() => requestAnimationFrame(step));
  };
  // the mode that swung stands at its end again
  const settle = () => {
    if (moved) Plotly.restyle(chart, {x: [moved.ends[0]], y: [moved.ends[1]], z: [moved.ends[2]]}, [moved.mode]);
    moved = null;
  };
  button.addEventListener("click", () => {
    const on = begun === null;
    begun = on ? performance.now() : null;
    button.textContent = on ? "Pause" : "Animate";
    if (on) requestAnimationFrame(step); else settle();
  });
}
