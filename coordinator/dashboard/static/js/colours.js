// Colours of what is drawn, for light and dark. UAV colours are Okabe and Ito's hues, darkened or
// lightened until they stand out from the ground by 3 : 1; ids beside them tell those apart that share one.

const UAVS = {
  light: ["#0072b2", "#b84a00", "#00785a", "#a3528a", "#8a6100", "#2a7fb5", "#5d5d5d"],
  dark: ["#4fa8e0", "#ff8a4c", "#2fc79a", "#e39ac6", "#f0b432", "#8fd3f7", "#c9c9c9"],
};

/** Whether the page is dark now. */
export function isDark() {
  const chosen = document.documentElement.dataset.theme;
  return chosen ? chosen === "dark" : window.matchMedia("(prefers-color-scheme: dark)").matches;
}

/** Colour of the UAV at that place of the fleet. */
export function uavColour(number, dark = isDark()) {
  const colours = UAVS[dark ? "dark" : "light"];
  return colours[number % colours.length];
}

/** What the map is drawn with, as the style sheet has it. */
export function inks() {
  const style = getComputedStyle(document.documentElement);
  const ink = (name) => style.getPropertyValue(`--${name}`).trim();
  return {
    dark: isDark(),
    text: ink("text"),
    muted: ink("muted"),
    faint: ink("grid"),
    ground: ink("ground"),
    trouble: ink("trouble"),
    accent: ink("accent"),
    font: ink("font"),
  };
}

const THEMES = [
  [null, "◐", "Colours: as the system has them"],
  ["light", "○", "Colours: light"],
  ["dark", "●", "Colours: dark"],
];
const KEPT_AS = "peckorder.theme";

/** Lets a button go through the themes; calls back after each change, the system's too. */
export function themeSwitch(button, onChange) {
  let chosen = remembered();
  const show = () => {
    const [name, title, tip] = THEMES.find(([key]) => key === chosen);
    if (name) document.documentElement.dataset.theme = name;
    else delete document.documentElement.dataset.theme;
    button.textContent = title;
    button.title = tip;
    button.setAttribute("aria-label", tip);
    onChange();
  };
  button.addEventListener("click", () => {
    chosen = THEMES[(THEMES.findIndex(([key]) => key === chosen) + 1) % THEMES.length][0];
    remember(chosen);
    show();
  });
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", onChange);
  show();
}

function remembered() {
  try {
    const kept = localStorage.getItem(KEPT_AS);
    return THEMES.some(([key]) => key === kept) ? kept : null;
  } catch {
    return null;
  }
}

function remember(theme) {
  try {
    if (theme) localStorage.setItem(KEPT_AS, theme);
    else localStorage.removeItem(KEPT_AS);
  } catch {
    // A browser that keeps nothing starts as the system has it.
  }
}
