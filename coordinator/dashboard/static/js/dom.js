// Making and changing elements. Text is only ever set as text, never as markup.

/** The element of that id; the page has all of them from the start. */
export function byId(id) {
  return document.getElementById(id);
}

/** A new element; properties whose value is null or false are left out, functions listen. */
export function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (value === null || value === false || value === undefined) continue;
    if (typeof value === "function") element.addEventListener(name, value);
    else if (name === "class") element.className = value;
    else element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children.filter((child) => child !== null && child !== undefined));
  return element;
}

/** Sets text only where it differs, so that an unchanged page costs nothing. */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Sets an attribute only where it differs; null takes it away. */
export function setAttribute(element, name, value) {
  if (value === null) element.removeAttribute(name);
  else if (element.getAttribute(name) !== value) element.setAttribute(name, value);
}

const SVG = "http://www.w3.org/2000/svg";

/** A new SVG element. */
export function draw(tag, properties = {}, ...children) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(properties)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

/** Whether a key press is meant for a field and not for the page. */
export function isTyping(event) {
  const where = event.target;
  return (
    where instanceof HTMLElement &&
    (where.matches("input:not([type=range]):not([type=checkbox]), textarea, select") ||
      where.closest("dialog") !== null)
  );
}
