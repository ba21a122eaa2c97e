// Radio buttons that look like one control: `names` in a fieldset, the one that is checked, what a choice does.

export function fill(fieldset, group, names, titleOf, onchoice) {
  fieldset.replaceChildren(...names.map((name, k) => {
    const label = document.createElement("label");
    const input = Object.assign(document.createElement("input"), { type: "radio", name: group, value: name });
    input.onchange = () => onchoice(name, k);
    label.title = titleOf(name, k);
    label.append(input, Object.assign(document.createElement("span"), { textContent: name }));
    return label;
  }));
}

export function check(fieldset, name) {
  for (const input of fieldset.querySelectorAll("input")) input.checked = input.value === name;
}
