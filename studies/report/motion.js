// Player of the motions of bodies in their cavities; its data are what studies/report/motion.py writes.
(() => {
  const SHAPES = "http://www.w3.org/2000/svg";
  const draw = (parent, name, attributes) => {
    const shape = document.createElementNS(SHAPES, name);
    for (const [key, value] of Object.entries(attributes)) shape.setAttribute(key, value);
    return parent.appendChild(shape);
  };

  // a cavity: returns the function that shows a frame; numbered: whether its bodies have numbers
  function cavity(parent, data, numbered) {
    const [x, y, width, height] = data.box;
    const figure = document.createElement("figure");
    const svg = draw(figure, "svg", {viewBox: data.box.join(" "), role: "img", "aria-label": `cavity ${data.name}`});
    const caption = document.createElement("figcaption");
    figure.style.flex = `${width} 1 ${2 * width}px`;
    figure.style.maxWidth = `${6 * width}px`;
    parent.append(figure);
    figure.append(caption);
    // where the cavity is at rest
    draw(svg, "path", {d: `M${x} 0H${x + width}M0 ${y}V${y + height}`, class: "rest"});
    const frame = draw(svg, "g", {});
    const ground = draw(frame, "path", {class: "walls"});
    const bodies = data.bodies.map(body => ({
      data: body,
      shape: draw(frame, body.round ? "circle" : "polygon", {class: "body", fill: body.colour, stroke: body.colour}),
      mark: body.round ? draw(frame, "line", {stroke: body.colour, "stroke-width": 1}) : null,
      name: numbered ? draw(frame, "text", {fill: body.colour}) : null,
    }));
    bodies.forEach(body => body.name && (body.name.textContent = body.data.number));
    const contacts = data.contacts.map(contact => ({data: contact, shape: draw(frame, "ellipse", {})}));
    const top = -data.height;

    return k => {
      const [along, across, turn] = data.shift[k], left = data.left[k], right = data.right[k], w = data.wall;
      frame.setAttribute("transform", `translate(${along} ${across}) rotate(${turn})`);
      const inside = data.ceiling.map(({ends, heights}, i, all) => {
        const [low, high] = heights[k];
        return `L${i ? ends[0] : left[1]} ${-low}L${i + 1 < all.length ? ends[1] : right[1]} ${-high}`;
      }).join("");
      ground.setAttribute("d", inside
        ? `M${left[0] - w} ${w}V${top - w}H${right[0] + w}V${w}ZM${left[0]} 0${inside}L${right[0]} 0Z`
        : `M${left[0] - w} ${w}V${top}H${left[1]}L${left[0]} 0H${right[0]}L${right[1]} ${top}H${right[0] + w}V${w}Z`);
      for (const body of bodies) {
        const points = body.data.outline[k];
        if (body.mark) {
          for (const [key, value] of [["cx", points[0]], ["cy", points[1]], ["r", body.data.radius]]) body.shape.setAttribute(key, value);
          ["x1", "y1", "x2", "y2"].forEach((key, i) => body.mark.setAttribute(key, points[i]));
        } else {
          body.shape.setAttribute("points", points.join(" "));
        }
        if (body.name) {
          const n = points.length / 2, place = body.mark ? 1 : n;
          const middle = i => points.filter((_, j) => j % 2 === i && j < 2 * place).reduce((sum, value) => sum + value, 0) / place;
          body.name.setAttribute("x", middle(0));
          body.name.setAttribute("y", middle(1) + 4);
        }
      }
      for (const contact of contacts) {
        const [cx, cy] = contact.data.points[k], light = contact.data.light[k];
        // a pad on the surface: its normal points out of the body
        const [nx, ny] = contact.data.normal, thick = light === "0" ? .7 : 1.4, long = light === "2" ? 5 : 3;
        for (const [key, value] of [["cx", cx + thick * nx], ["cy", cy + thick * ny], ["rx", nx ? thick : long], ["ry", nx ? long : thick]]) contact.shape.setAttribute(key, value);
        contact.shape.setAttribute("class", ["open", "closed", "hit"][light]);
      }
      caption.textContent = data.name + ": " + data.bodies.map(body => {
        const parts = [`${body.along[k].toFixed(1)} µm along`];
        if (body.lift) parts.push(`${body.lift[k].toFixed(1)} µm up`);
        if (body.tilt && !body.round) parts.push(`${body.tilt[k].toFixed(2)} mrad`);
        return (numbered ? `body ${body.number} ` : "") + parts.join(", ");
      }).join("; ");
    };
  }

  function player(root) {
    const data = JSON.parse(root.querySelector("script").textContent);
    const stage = root.querySelector(".stage"), slider = root.querySelector("input"), button = root.querySelector("button");
    const speed = root.querySelector("select"), told = root.querySelector("output");
    const numbered = data.cavities.reduce((sum, each) => sum + each.bodies.length, 0) > 1;
    const cavities = data.cavities.map(each => cavity(stage, each, numbered));
    const frames = data.time.length;
    let at = data.first, before = null;
    const show = () => {
      const k = Math.floor(at);
      cavities.forEach(frame => frame(k));
      slider.value = k;
      told.textContent = `period ${data.time[k].toFixed(3)}, structure at ${data.displacement[k].toFixed(2)} µm`;
    };
    const step = now => {
      if (before === null) return;
      at = (at + Math.max(now - before, 0) / 1000 * data.each / speed.value) % frames;
      before = now;
      show();
      requestAnimationFrame(step);
    };
    const play = on => {
      before = on ? performance.now() : null;
      button.textContent = on ? "Pause" : "Play";
      if (on) requestAnimationFrame(step);
    };
    slider.max = frames - 1;
    slider.addEventListener("input", () => { play(false); at = Number(slider.value); show(); });
    button.addEventListener("click", () => play(before === null));
    show();
  }
  document.querySelectorAll(".motion").forEach(player);
})();
