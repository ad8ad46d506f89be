// Saying something to the server: one POST each, with the operator's token where one is wanted.

const KEPT_AS = "peckorder.token";

/** What the server refused, or that it could not be reached (status 0). */
export class Refusal extends Error {
  constructor(status, text) {
    super(text);
    this.status = status;
  }
}

/** Sends `body`; the number of the command in the feed. Throws Refusal. */
export async function post(path, body, token) {
  let response;
  try {
    response = await fetch(new URL(path, document.baseURI), {
      method: "POST",
      headers: { "Content-Type": "application/json", ...(token ? { Authorization: `Bearer ${token}` } : {}) },
      body: JSON.stringify(body),
      credentials: "same-origin",
      redirect: "error",
      signal: AbortSignal.timeout(10_000),
    });
  } catch {
    throw new Refusal(0, "The server cannot be reached; it is not known whether it has heard this.");
  }
  const answer = await response.json().catch(() => ({}));
  if (!response.ok)
    throw new Refusal(response.status, answer.error ?? `The server refused it (${response.status}).`);
  return answer.n ?? null;
}

/** The token, for as long as this tab lives; never part of an address. */
export const token = {
  get() {
    try {
      return sessionStorage.getItem(KEPT_AS);
    } catch {
      return this.kept ?? null;
    }
  },
  set(value) {
    this.kept = value;
    try {
      if (value) sessionStorage.setItem(KEPT_AS, value);
      else sessionStorage.removeItem(KEPT_AS);
    } catch {
      // Kept in memory then.
    }
  },
};
