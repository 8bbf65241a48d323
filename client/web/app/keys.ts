// The API key: asked for when the daemon wants one, held in memory, and for the tab if wished.
import { byId, fill, h } from "./dom";
import { T } from "./texts";

const IS_KEY = /^[\x21-\x7e]+$/; // others cannot be in a header
const STORED = "voxeld-key"; // in sessionStorage, which ends with the tab

export class Keys {
  /** After the key was forgotten. */
  declare onForget: () => void;
  readonly #dialog = byId<HTMLDialogElement>("dialog");

  /** The key that the tab remembers. */
  stored(): string | null {
    try {
      const key = sessionStorage.getItem(STORED);
      if (key !== null && IS_KEY.test(key)) return key;
      sessionStorage.removeItem(STORED);
    } catch {
      /* storage is off */
    }
    return null;
  }

  forget(): void {
    try {
      sessionStorage.removeItem(STORED);
    } catch {
      /* there is none */
    }
    this.onForget();
  }

  /** Asks until a key is given. `refused`: the key that the daemon does not take. */
  ask(refused: string | null): Promise<string> {
    const input = h("input", {
      type: "password",
      id: "key",
      autocomplete: "off",
      required: true,
      spellcheck: false,
      oninput: () => input.setCustomValidity(""),
    });
    const stay = h("input", { type: "checkbox", checked: this.stored() !== null });
    return new Promise(resolve => {
      const take = (event: Event) => {
        event.preventDefault();
        const key = input.value.trim();
        if (!IS_KEY.test(key)) {
          input.setCustomValidity(T.keyBad);
          input.reportValidity();
          return;
        }
        try {
          if (stay.checked) sessionStorage.setItem(STORED, key);
          else sessionStorage.removeItem(STORED);
        } catch {
          /* then it is in memory alone */
        }
        this.#dialog.onclose = null;
        this.#dialog.close();
        resolve(key);
      };
      fill(
        this.#dialog,
        h(
          "form",
          { onsubmit: take },
          h("h2", { id: "dialog-title" }, T.keyTitle),
          refused !== null && h("p", { className: "error", role: "alert" }, T.keyWrong),
          h("label", { htmlFor: "key" }, T.keyField),
          input,
          h("label", { className: "check" }, stay, T.keyStay),
          h("p", { className: "note" }, T.keyHint),
          h("p", { className: "row" }, h("button", { className: "primary" }, T.keyUse)),
        ),
      );
      const open = () => {
        if (!this.#dialog.open) this.#dialog.showModal();
        input.focus();
      };
      this.#dialog.onclose = open; // by Escape: nothing works without a key
      open();
    });
  }
}
