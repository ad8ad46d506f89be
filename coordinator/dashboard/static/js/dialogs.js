// Questions to the operator, each a <dialog> with a form.

import { make, setText } from "./dom.js";
import { Refusal, post, token } from "./say.js";

let asked = 0;

/** A labelled field. */
export function field(label, input, hint = null) {
  return make(
    "label",
    { class: "field" },
    make("span", {}, label),
    input,
    hint ? make("small", {}, hint) : null,
  );
}

/** The field for the operator's reason, which goes into the log. */
export function reasonField() {
  return make("input", {
    name: "reason",
    type: "text",
    maxlength: "200",
    autocomplete: "off",
    placeholder: "goes into the log",
  });
}

/**
 * Asks, and resolves to what `send(form)` resolved to, or to null when it was dismissed. What the
 * server refuses is shown in the dialog, which stays open.
 *
 * @param title, text what is asked.
 * @param fields elements of the form.
 * @param confirm label of the button that does it.
 * @param danger whether that moves aircraft.
 * @param send takes FormData.
 */
export function ask({ title, text, fields = [], confirm, danger = false, send }) {
  asked += 1;
  const id = `dialog-${asked}`;
  return new Promise((resolve) => {
    const fault = make("p", { class: "fault", role: "alert" });
    // Fields are for who wants them: on a touch screen no keyboard covers half of the question.
    const touch = window.matchMedia("(pointer: coarse)").matches;
    const yes = make(
      "button",
      { type: "submit", class: danger ? "danger" : "primary", autofocus: touch },
      confirm,
    );
    const no = make("button", { type: "button", click: () => dialog.close() }, "Cancel");
    const form = make(
      "form",
      { method: "dialog" },
      make("h2", { id }, title),
      text ? make("p", {}, text) : null,
      ...fields,
      fault,
      make("menu", {}, no, yes),
    );
    const dialog = make("dialog", { "aria-labelledby": id }, form);
    let told = null;
    form.addEventListener("submit", async (event) => {
      event.preventDefault();
      if (yes.disabled) return;
      yes.disabled = true;
      setText(fault, "");
      try {
        told = await send(new FormData(form));
        dialog.close();
      } catch (error) {
        setText(fault, error instanceof Refusal ? error.message : String(error));
      }
      yes.disabled = false;
    });
    dialog.addEventListener("close", () => {
      dialog.remove();
      resolve(told);
    });
    document.body.append(dialog);
    dialog.showModal();
  });
}

/** Posts, and asks for the token again if the server did not take the one there is. */
export async function postWithToken(path, body) {
  for (;;) {
    try {
      return await post(path, body, token.get());
    } catch (error) {
      if (!(error instanceof Refusal) || error.status !== 401) throw error;
      if ((await theToken(true)) === null)
        throw new Refusal(401, "Nothing was done: the token is missing or wrong.");
    }
  }
}

/** The token of this tab, asked for where there is none or it was wrong; null without any. */
export async function theToken(wrong) {
  if (wrong) token.set(null);
  if (token.get()) return token.get();
  asking ??= askToken(
    wrong
      ? "The server did not accept that token."
      : "This server shows and commands a mission only to who has its token.",
  );
  await asking;
  asking = null;
  return token.get();
}

let asking = null;

function askToken(text) {
  return ask({
    title: "Operator token",
    text: `${text} It is printed where the dashboard was started, and kept in this tab only.`,
    fields: [
      field(
        "Token",
        make("input", {
          name: "token",
          type: "password",
          required: true,
          autocomplete: "off",
          spellcheck: "false",
        }),
      ),
    ],
    confirm: "Use it",
    send: async (form) => {
      token.set(form.get("token").trim());
      return true;
    },
  });
}
