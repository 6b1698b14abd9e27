"use strict";
(() => {
  const held = JSON.parse(document.getElementById("figures").textContent);
  const config = {
    responsive: true, displaylogo: false, displayModeBar: true, scrollZoom: false,
    plotlyServerURL: "", showSendToCloud: false, showLink: false,  // nothing leaves the page
    toImageButtonOptions: { format: "svg" },
  };
  const buttons = (figure) => (figure.views ? [["toImage", "resetCameraDefault3d"]] : [["toImage", "zoom2d", "pan2d", "resetScale2d"]]);

  // What the data leaves to the page: colours of the theme, arrays that several figures draw.
  const resolve = (value, style) => {
    if (Array.isArray(value)) {
      return value.some((item) => item !== null && typeof item === "object") ? value.map((item) => resolve(item, style)) : value;
    }
    if (value === null || typeof value !== "object") return value;
    if (typeof value.css === "string") return style.getPropertyValue(value.css).trim();
    if (typeof value.shared === "string") return held.shared[value.shared];
    return Object.fromEntries(Object.entries(value).map(([key, item]) => [key, resolve(item, style)]));
  };

  const posture = document.getElementById("posture");
  const magnification = document.getElementById("magnification");
  const magnified = document.getElementById("magnified");
  const camera = document.getElementById("camera");

  const plus = (values, ways, factor) => {
    if (ways === undefined || ways === null) return values;
    if (!Array.isArray(ways)) {  // the whole moves alike
      const shift = factor * ways;
      return values.map((one) => (Array.isArray(one) ? one.map((item) => item + shift) : one === null ? null : one + shift));
    }
    return values.map((one, at) => (one === null ? null : one + factor * ways[at]));
  };

  // The robot in the posture chosen, its displacement magnified.
  const robot = (figure, style) => {
    const view = figure.views[Number(posture.value)];
    const factor = Number(magnification.value);
    const traces = resolve(figure.traces, style).map((trace, at) => {
      const { dx, dy, dz, x, y, z, shares, ...more } = resolve(view.traces[at], style);
      const moved = { ...trace, ...more, x: plus(x, dx, factor), y: plus(y, dy, factor), z: plus(z, dz, factor) };
      if (trace.type === "mesh3d") return { ...moved, intensity: shares };
      const part = trace.mode === "markers" ? "marker" : "line";
      return shares ? { ...moved, [part]: { ...trace[part], color: shares } } : moved;
    });
    const layout = resolve(figure.layout, style);
    layout.scene.annotations = view.labels.map((one) => ({
      text: one.text, showarrow: true, arrowhead: 6, arrowsize: 0.6, arrowwidth: 1.2,
      x: one.at[0] + factor * one.by[0], y: one.at[1] + factor * one.by[1], z: one.at[2] + factor * one.by[2],
      font: { color: layout.font.color, size: 13 }, arrowcolor: layout.font.color,
      bgcolor: style.getPropertyValue("--panel").trim(), borderpad: 2, opacity: 0.9,
    }));
    // lengths as they are, the diagonal always as long
    const lengths = Object.entries(view.ranges).map(([name, [low, high]]) => [name, high - low]);
    const longest = Math.max(...lengths.map(([, length]) => length));
    const diagonal = Math.hypot(...lengths.map(([, length]) => length));
    layout.scene.aspectratio = Object.fromEntries(lengths.map(([name, length]) => [name, 1.6 * length / diagonal]));
    for (const [name, length] of lengths) {  // ticks where there is room for them
      Object.assign(layout.scene[`${name}axis`], { range: view.ranges[name], nticks: Math.max(2, Math.round(6 * length / longest)) });
    }
    layout.uirevision = "kept";  // the view that people turned to stays
    return [traces, layout];
  };

  // Labels stand in a column on either side of the robot, each with a line to its place: none hides another.
  const beside = (layout, width) => {
    const { eye: from, center = { x: 0, y: 0, z: 0 } } = layout.scene.camera;
    const eye = { x: from.x - center.x, y: from.y - center.y, z: from.z - center.z };
    const far = Math.hypot(eye.x, eye.y, eye.z);
    const round = Math.hypot(eye.x, eye.y) || 1;
    const across = eye.x || eye.y ? [-eye.y / round, eye.x / round, 0] : [1, 0, 0];
    const up = [-eye.x * eye.z / (round * far), -eye.y * eye.z / (round * far), round / far];
    const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    const seen = (point) => {  // pixels from the middle of the figure
      const at = ["x", "y", "z"].map((name) => {
        const [low, high] = layout.scene[`${name}axis`].range;
        return layout.scene.aspectratio[name] * ((point[name] - low) / (high - low) - 0.5) - center[name];
      });
      const pixels = layout.height / (2 * Math.tan(Math.PI / 8) * (far - dot(at, [eye.x, eye.y, eye.z]) / far));
      return { x: pixels * dot(at, across), y: -pixels * dot(at, up) };
    };
    const placed = layout.scene.annotations.map((one) => ({ one, ...seen(one) })).sort((a, b) => a.x - b.x);
    placed.forEach((one, at) => { one.side = 2 * at + 1 < placed.length ? "left" : "right"; });
    const last = { left: -Infinity, right: -Infinity };
    const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((bits) => Math.abs(seen(Object.fromEntries(["x", "y", "z"].map((name, at) => [name, layout.scene[`${name}axis`].range[(bits >> at) & 1]]))).x));
    // where the columns begin and end: beyond the axes and their titles, and so that a long label stays in the figure
    const edge = Math.min((width < 480 ? 0.48 : 0.4) * width, Math.max(...corners) + 140);
    placed.sort((a, b) => a.y - b.y).forEach(({ one, side, x, y }) => {
      last[side] = Math.max(y, last[side] + 28);
      Object.assign(one, { xanchor: side, ax: (side === "left" ? -edge : edge) - x, ay: last[side] - y - 8 });
    });
  };

  // A title with so many characters a line at most: what is wider than its figure is cut.
  const wrapped = (title, most) => ({ ...title, text: title.text.replace(new RegExp(`(?=.{${most + 1}})(.{1,${most}}) `, "g"), "$1<br>") });

  const draw = (plot) => {
    const key = plot.dataset.figure;
    const figure = held.figures[key];
    const style = getComputedStyle(document.documentElement);
    const [traces, layout] = figure.views ? robot(figure, style) : [resolve(figure.traces, style), resolve(figure.layout, style)];
    layout.hoverlabel = { ...layout.hoverlabel, bgcolor: style.getPropertyValue("--panel").trim(), font: { color: layout.font.color } };
    layout.modebar = { bgcolor: "rgba(0,0,0,0)", color: style.getPropertyValue("--muted").trim(), activecolor: layout.font.color };
    layout.legend = { ...layout.legend, bgcolor: "rgba(0,0,0,0)" };
    if (!figure.views) layout.dragmode = plot.layout ? plot.layout.dragmode : false;  // a finger scrolls the page
    const narrow = plot.clientWidth < 480;
    if (layout.scene) {  // the camera steps back, on a phone or paper further, so that no title of an axis is cut
      const back = plot.clientWidth < 700 ? 1.3 : 1.15;
      layout.scene.camera = { ...layout.scene.camera, eye: Object.fromEntries(Object.entries(layout.scene.camera.eye).map(([name, value]) => [name, back * value])) };
    }
    if (narrow && layout.scene) {
      layout.height = 440;
      layout.scene.domain = { x: [0, 1], y: [0.14, 1] };  // the bar of colours, or the legend, is below
      layout.legend = { ...layout.legend, y: 0, yanchor: "bottom" };
      (layout.scene.annotations || []).forEach((one) => { one.font = { ...one.font, size: 11 }; });
      traces.forEach((trace) => { if (trace.line && trace.line.colorbar) trace.line.colorbar = { ...trace.line.colorbar, orientation: "h", y: 0, yanchor: "bottom", len: 0.9, title: { ...wrapped(trace.line.colorbar.title, 36), side: "top" } }; });
    }
    if (figure.views) beside(layout, plot.clientWidth);
    if (narrow && layout.xaxis && !layout.xaxis.ticktext) layout.xaxis = { nticks: plot.clientWidth < 300 ? 4 : 5, tickangle: 0, ...layout.xaxis };
    if (narrow && layout.yaxis && layout.yaxis.ticktext) {  // room for what is drawn; the tables hold the names
      layout.yaxis.ticktext = layout.yaxis.ticktext.map((text) => text.replace(" at ", "<br>at ").split("<br>").map(
        (line) => (line.length > 24 ? `${line.slice(0, 22)}…` : line)).join("<br>"));
      layout.yaxis.tickfont = { size: 11 };
      const title = wrapped(layout.xaxis.title, 18), more = title.text.split("<br>").length - 1;
      layout.xaxis.title = { ...title, standoff: title.standoff + 12 * more };  // which is to the middle of its lines
      layout.height += 18 * more;
      layout.height += 10 * layout.yaxis.ticktext.filter((text) => text.includes("<br>")).length;
    }
    if (narrow && !figure.views && layout.margin.t > 60) {  // a legend has no buttons above it then
      layout.margin.t -= 26;
      layout.height -= 26;
    }
    // paper does not wait for a figure to find out how wide it may be
    if (document.documentElement.dataset.theme === "print") layout.width = plot.clientWidth;
    plot.style.minHeight = `${layout.height}px`;
    if (plot.dataset.narrow !== String(narrow)) Plotly.purge(plot);  // a bar of colours that was turned leaves its labels
    plot.dataset.narrow = String(narrow);
    // narrow figures have no room for buttons above their legend
    return Plotly.react(plot, traces, layout, { ...config, displayModeBar: !narrow || Boolean(figure.views), modeBarButtons: buttons(figure) });
  };

  const plots = [...document.querySelectorAll(".plot")];
  const seen = (plot) => !plot.closest("details:not([open])");  // what is closed has no width to draw in
  const drawAll = () => Promise.all(plots.filter(seen).map(draw));
  document.querySelectorAll("details.part").forEach((part) => part.addEventListener("toggle", () => {
    if (part.open && document.documentElement.dataset.theme !== "print") part.querySelectorAll(".plot").forEach(draw);
  }));
  document.querySelectorAll("nav a").forEach((link) => link.addEventListener("click", () => {
    const part = document.querySelector(`${link.hash} > details.part`);
    if (part) part.open = true;
    if (!wide.matches) menu.open = false;
  }));
  const menu = document.querySelector(".menu");
  const wide = matchMedia("(min-width: 1000px)");  // the list of contents stands at the side, else it is a menu
  const fold = () => { menu.open = wide.matches; };
  wide.addEventListener("change", fold);
  fold();

  const tell = () => {
    const text = `× ${Number(Number(magnification.value).toPrecision(3)).toLocaleString("en")}`;
    magnified.textContent = text;
    magnification.setAttribute("aria-valuetext", text);
  };
  if (posture) {
    const plot = document.getElementById("plot-robot");
    let waiting = false;
    const again = () => {
      tell();
      if (waiting) return;
      waiting = true;
      requestAnimationFrame(() => { waiting = false; draw(plot); });
    };
    tell();
    posture.addEventListener("change", again);
    magnification.addEventListener("input", again);
    const cameras = JSON.parse(camera.dataset.cameras);
    const views = held.figures[plot.dataset.figure].views;
    const look = () => {  // the first camera follows the posture, where the deflection is seen
      const own = camera.selectedIndex === 0 && views[Number(posture.value)].camera;
      return Plotly.relayout(plot, { "scene.camera": own || cameras[camera.value] });
    };
    camera.addEventListener("change", look);
    posture.addEventListener("change", () => { if (camera.selectedIndex === 0) look(); });
  }

  document.getElementById("save").addEventListener("click", () => {
    const text = JSON.stringify(JSON.parse(document.getElementById("result").textContent), null, 2);
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([text], { type: "application/json" }));
    link.download = "result.json";
    link.click();
    URL.revokeObjectURL(link.href);
  });

  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawAll);
  let resized = 0, width = innerWidth;
  addEventListener("resize", () => {  // labels are cut for the width that there was; a phone's bars move heights alone
    clearTimeout(resized);
    if (innerWidth !== width && document.documentElement.dataset.theme !== "print") resized = setTimeout(() => { width = innerWidth; drawAll(); }, 150);
  });
  let closed = [];
  addEventListener("beforeprint", () => {
    document.documentElement.dataset.theme = "print";
    closed = [...document.querySelectorAll("details:not([open])")].filter((one) => !one.closest("#rows, #targets, nav"));
    closed.forEach((one) => { one.open = true; });
    drawAll();
  });
  addEventListener("afterprint", () => {
    delete document.documentElement.dataset.theme;
    closed.forEach((one) => { one.open = false; });
    drawAll().then(() => plots.filter(seen).forEach((plot) => Plotly.Plots.resize(plot)));
  });

  // One at a time, from the top, so that the page answers meanwhile.
  (async () => {
    for (const plot of plots.filter(seen)) {
      await draw(plot);
      await new Promise((go) => setTimeout(go));
    }
    document.documentElement.dataset.drawn = String(plots.length);
  })();
})();
