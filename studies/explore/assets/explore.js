// The page's part in the browser: sliders and fields agree, and at most two requests are under way.
window.dash_clientside = window.dash_clientside || {};

(function () {
  const same = window.dash_clientside;
  const quiet = () => same.no_update;
  // the request under way, and when it was sent
  let sent = null;
  let version = 0;
  let pumped = 0;
  // ms, after which an answer counts as lost
  const PATIENCE = 10000;

  const position = (control, number) => (control.log ? Math.log10(number) : number);

  const rounded = (control, place) => {
    const number = control.log ? 10 ** place : place;
    return control.whole ? Math.round(number) : Number(number.toPrecision(4));
  };

  same.explore = {
    // a slider and its field show the same number; a field may hold one beyond the slider, or nonsense
    agree: function (place, text, control) {
      const slider = document.getElementById("slider-" + control.name);
      const moved = same.callback_context.triggered_id === "slider-" + control.name;
      const shown = moved ? String(rounded(control, Number(place))) : text;
      if (slider) slider.setAttribute("aria-valuetext", shown + " " + control.unit);
      if (moved) return [quiet(), shown];
      const number = Number(text);
      if (!Number.isFinite(number) || (control.log && number <= 0)) return [quiet(), quiet()];
      const wished = Math.min(Math.max(position(control, number), control.low), control.high);
      return [wished, quiet()];
    },

    // whether the run that was asked for is the one that is shown
    seen: function (run, shown) {
      return !run || run === shown;
    },

    // whether a motion that was asked for is that of the scene seen now
    stale: function (scene, sweep, asked) {
      const now = scene && JSON.stringify({ scene: scene, sweep: sweep });
      return !asked || !now || JSON.stringify(asked) === now ? "" : "The scene has changed since: Show runs it as it is now.";
    },

    // all fields, each change with a number of its own
    gather: function () {
      const texts = Array.from(arguments);
      const names = texts.pop();
      const values = {};
      names.forEach((name, k) => { values[name] = texts[k] === null || texts[k] === undefined ? "" : String(texts[k]); });
      version += 1;
      return { version: version, values: values };
    },

    // ask for what is wanted now: the newest values, or the rest of their curve; never two curves' beginnings at once
    pump: function (wanted, answer, _ticks, tab) {
      if (sent && answer && answer.serial === sent.serial) sent = null;
      if (!wanted) return;
      const lost = sent && Date.now() - sent.time > PATIENCE;
      if (lost) {
        same.set_props("message", { children: "no answer: has vanedamp ended?", className: "message bad" });
        same.set_props("frame", { className: "old" });
      }
      if (sent && !lost && !(sent.have > 0 && sent.version !== wanted.version)) return;
      const current = answer && answer.version === wanted.version;
      if (current && answer.complete) return;
      const serial = (pumped += 1);
      sent = { serial: serial, version: wanted.version, have: current ? answer.have : 0, time: Date.now() };
      same.set_props("request", {
        data: { tab: tab, serial: serial, version: wanted.version, values: wanted.values, have: sent.have },
      });
    },
  };
})();
