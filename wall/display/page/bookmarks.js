// Cameras that were kept: a button for each goes there. All pages of a run share them.

const MOST = 9;                   // wall/geometry/steering.py, BOOKMARKS

export class Bookmarks {
  #group; #send; #known = ""; #numbers = []; #last = 0;

  // `group` holds the button that keeps; `send` takes a command.
  constructor(group, keep, send) {
    this.#group = group;
    this.#send = send;
    keep.onclick = () => this.keep();
  }

  show(numbers) {
    if (numbers.join() === this.#known) return;
    this.#known = numbers.join();
    this.#numbers = numbers;
    for (const old of this.#group.querySelectorAll("[data-bookmark]")) old.remove();
    this.#group.append(...numbers.map((number) => {
      const button = Object.assign(document.createElement("button"), { type: "button", textContent: String(number) });
      button.dataset.bookmark = number;
      button.title = `Go to kept camera ${number} (v: the next)`;
      button.setAttribute("aria-label", `Kept camera ${number}`);
      button.onclick = () => this.#recall(number);
      return button;
    }));
  }

  // In the first free place; when all are taken, in that of the last one used.
  keep() {
    const free = Array.from({ length: MOST }, (_, k) => k + 1).find((number) => !this.#numbers.includes(number));
    this.#last = free ?? (this.#last || MOST);
    this.#send({ kind: "bookmark", value: String(this.#last) });
  }

  next() {
    if (!this.#numbers.length) return;
    this.#recall(this.#numbers.find((number) => number > this.#last) ?? this.#numbers[0]);
  }

  #recall(number) {
    this.#last = number;
    this.#send({ kind: "recall", value: String(number) });
  }
}
