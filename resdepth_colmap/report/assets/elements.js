// The data; elements and numbers as people read them. All text goes in as text, never as
// HTML.

const report = JSON.parse(document.getElementById("report-data").textContent);

function byId(id) {
  return document.getElementById(id);
}

function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [key, value] of Object.entries(properties)) {
    if (key in element) element[key] = value;
    else element.setAttribute(key, value);
  }
  element.append(...children.filter((child) => child !== null));
  return element;
}

function rangeOf(values) {
  let low = Infinity;
  let high = -Infinity;
  for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return [low, high];
}

const NOT_KNOWN = "–";

function percent(share, digits = 1) {
  return share === null || share === undefined ? NOT_KNOWN : `${(100 * share).toFixed(digits)} %`;
}

function signedPercent(share) {
  const digits = Math.abs(share) < 0.01 ? 2 : 1;
  const text = `${(100 * share).toFixed(digits)} %`;
  return share > 0 ? `+${text}` : text.replace("-", "−");
}

function count(number) {
  return number === null || number === undefined ? NOT_KNOWN : Math.round(number).toLocaleString("en");
}

function length(value) {
  if (value === null || value === undefined) return NOT_KNOWN;
  if (value === 0) return "0";
  const digits = Math.min(8, Math.max(0, 3 - Math.floor(Math.log10(Math.abs(value)))));
  return value.toFixed(digits);
}

// Few digits, for the axis of a chart.
function brief(value) {
  return String(Number(value.toPrecision(3))).replace("-", "−");
}

function duration(seconds) {
  if (seconds === null || seconds === undefined) return NOT_KNOWN;
  if (seconds < 9.95) return `${seconds.toFixed(1)} s`;
  if (seconds < 90) return `${seconds.toFixed(0)} s`;
  if (seconds < 5400) return `${(seconds / 60).toFixed(0)} min`;
  return `${(seconds / 3600).toFixed(1)} h`;
}

function spoken(name) {
  const text = String(name).replaceAll("_", " ");
  return text.charAt(0).toUpperCase() + text.slice(1);
}

function themeColor(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

// Radio buttons that look like one control; `choose` is called with the chosen key.
function segments(fieldset, choices, chosen, choose) {
  fieldset.querySelectorAll("label").forEach((label) => label.remove());
  for (const [key, text] of choices) {
    const input = make("input", { type: "radio", name: fieldset.id, value: key, checked: key === chosen });
    input.addEventListener("change", () => choose(key));
    fieldset.append(make("label", {}, input, make("span", { textContent: text })));
  }
}

function definitions(list, rows) {
  const parts = rows.flatMap(([term, value]) => [
    make("dt", { textContent: term }),
    make("dd", { textContent: value }),
  ]);
  list.replaceChildren(...parts);
}
