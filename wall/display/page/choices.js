// What the wall shows: a list of what else it offers, and what came of choosing.

const SAID_MS = 10000;            // why it was refused
const ID = "choose";              // of our requests

export class Choices {
  #box; #list; #words; #send; #shown = ""; #asked = ""; #later;

  // `box` holds the list and is hidden where nothing is offered; `send` takes a request.
  constructor(box, list, words, send) {
    this.#box = box;
    this.#list = list;
    this.#words = words;
    this.#send = send;
    list.onchange = () => this.#choose(list.value);
  }

  show({ names, shown }) {
    const own = shown && names.includes(shown) ? [] : [new Option("as it runs", "")];
    this.#box.hidden = names.length < 2 - own.length;
    this.#list.replaceChildren(...own, ...names.map((name) => new Option(name, name)));
    this.#shown = own.length ? "" : shown;
    this.#list.value = this.#asked || this.#shown;
  }

  // What came of a request; another one's is left alone.
  answer({ id, refused }) {
    if (id !== ID) return;
    this.#say(refused ? `${this.#asked}: refused. ${refused}` : "");
    this.#asked = "";
    if (refused) this.#list.value = this.#shown;
    this.#list.disabled = false;
    clearTimeout(this.#later);
    if (refused) this.#later = setTimeout(() => this.#say(""), SAID_MS);
  }

  // The connection is lost: nobody answers any more.
  lost() {
    if (this.#asked) this.answer({ id: ID });
  }

  #choose(name) {
    if (!name || name === this.#shown) return;
    clearTimeout(this.#later);
    this.#asked = name;
    this.#list.disabled = true;
    this.#list.blur();            // keys are the wall's again: z goes back
    this.#say(`Loading ${name}`);
    this.#send({ kind: "choose", id: ID, name });
  }

  #say(text) {
    this.#words.textContent = text;
    this.#words.hidden = !text;
  }
}
