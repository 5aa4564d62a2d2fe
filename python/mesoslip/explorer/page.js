"use strict"
// Fills the elements of the page with what the program says, and asks it for what its user wants.
const explorer = (() => {
  const model = (name) => Bokeh.documents[0].get_model_by_name(name)
  const element = (id) => document.getElementById(id)
  const narrow = matchMedia("(max-width: 800px)"), dark = matchMedia("(prefers-color-scheme: dark)")
  let sent = 0, answered = 0, before = {}, timer = 0

  const ask = (action, name = "", value = null) => {
    if (!window.Bokeh?.documents.length) return
    sent += 1
    model("requests").tags = [sent, action, name, value]
  }

  const set = (one, property, value) => { if (one[property] !== value) one[property] = value }

  // Text with the indices of symbols such as X_c below the line.
  const indexed = (text) => text.split(/(?<=\b\p{L})_(\w)\b/u).map((part, place) => {
    if (place % 2 == 0) return part
    const index = document.createElement("sub")
    index.textContent = part
    return index
  })

  // A field that is being typed in, or was changed since, is left as it is.
  const setValue = (field, value) => {
    if (answered >= sent && !field.dataset.typed) set(field, "value", String(value))
  }

  const showKnob = (key, what) => {
    const knob = element(`knob:${key}`), field = element(key), slider = element(`${key}:slider`)
    const message = element(`${key}:message`)
    set(knob, "hidden", what.hidden)
    knob.classList.toggle("changed", what.was != "" && !what.isError)
    knob.classList.toggle("refused", what.isError)
    set(knob.querySelector(".was"), "textContent", what.was)
    set(message, "textContent", what.message)
    message.classList.toggle("error", what.isError)
    field.setAttribute("aria-invalid", what.isError)
    for (const option of field.options ?? [])
      if (what.omitted) set(option, "hidden", option.value == what.omitted)
      else set(option, "hidden", false)
    // A run may begin with what cannot be chosen, such as a slider under a force.
    const options = [...(field.options ?? [])]
    if (options.length && what.value && !options.some((one) => one.value == what.value))
      field.add(new Option(what.value, what.value))
    setValue(field, what.value)
    if (slider) {
      setValue(slider, what.position)
      slider.setAttribute("aria-valuetext", what.value)
    }
  }

  const showRows = (body, rows, cell) => {
    body.replaceChildren(...rows.map((row) => {
      const line = document.createElement("tr")
      line.append(...row.map((text, place) => {
        const one = document.createElement(place == 0 ? "th" : cell)
        one.textContent = text
        if (place == 0) one.scope = "row"
        return one
      }))
      return line
    }))
  }

  const showElement = (id, what) => {
    if ("was" in what) return showKnob(id, what)
    const one = element(id)
    if ("text" in what) set(one, "textContent", what.text)
    if ("symbols" in what) one.replaceChildren(...indexed(what.symbols))
    if ("hidden" in what) set(one, "hidden", what.hidden)
    if ("disabled" in what) set(one, "disabled", what.disabled)
    if ("pressed" in what) one.setAttribute("aria-pressed", what.pressed)
    if ("class" in what) set(one, "className", what.class)
    if ("max" in what) set(one, "max", String(what.max))
    if ("value" in what) setValue(one, what.value)
    if ("valuetext" in what) one.setAttribute("aria-valuetext", what.valuetext)
    if ("rows" in what) showRows(one, what.rows, "td")
    if ("heads" in what) one.replaceChildren(...what.heads.map((text) => {
      const head = document.createElement(text ? "th" : "td")
      head.textContent = text
      if (text) head.scope = "col"
      return head
    }))
    if ("turn" in what) Object.assign(one.dataset, {turn: what.turn, part: what.part})
    if ("address" in what) history.replaceState(null, "", what.address || location.pathname)
    if ("title" in what) document.title = what.title
  }

  // What a screen reader says: the status and the verdict when both are at rest.
  const announce = () => {
    clearTimeout(timer)
    timer = setTimeout(() => {
      const said = ["error", "status", "verdict"].map((id) => element(id).textContent)
      set(element("announcement"), "textContent", said.filter((text) => text).join(". "))
    }, 1000)
  }

  const show = (state) => {
    answered = state.answered
    for (const [id, what] of Object.entries(state.elements)) {
      const text = JSON.stringify(what)
      // A value that was not applied, as it was being changed, is applied later.
      if (before[id] === text && !("value" in what)) continue
      before[id] = text
      showElement(id, what)
    }
    announce()
  }

  const color = () => {
    const chosen = element("colours").value, root = document.documentElement
    root.classList.toggle("light", chosen == "light")
    root.classList.toggle("dark", chosen == "dark")
    root.classList.toggle("in-the-dark", chosen ? chosen == "dark" : dark.matches)
    localStorage.setItem("mesoslip-colours", chosen)
  }

  const copy = (button, text) => navigator.clipboard.writeText(text).then(() => {
    const name = button.textContent
    button.textContent = "copied"
    setTimeout(() => { button.textContent = name }, 1500)
  })

  document.addEventListener("DOMContentLoaded", () => {
    document.documentElement.lang = "en"
    // On a narrow page only the first group of knobs is open.
    if (narrow.matches)
      document.querySelectorAll("details").forEach((group, place) => { group.open = place == 0 })
    set(element("colours"), "value", localStorage.getItem("mesoslip-colours") ?? "")
    color()
    dark.addEventListener("change", color)
    element("colours").addEventListener("change", color)
    element("copy-command").onclick = (event) => copy(event.target, element("command").textContent)
    element("copy-link").onclick = (event) => copy(event.target, location.href)
    document.addEventListener("input", ({target}) => {
      if (target.type == "range")
        ask(target.dataset.action ?? "move", target.dataset.key, Number(target.value))
      else if (target.type == "text") target.dataset.typed = "yes"
    })
    document.addEventListener("change", ({target}) => {
      delete target.dataset.typed
      if (target.dataset.key && target.type != "range") ask("set", target.dataset.key, target.value)
      else if (target.dataset.action == "preset") ask("preset", "", target.value)
    })
    document.addEventListener("focusout", ({target}) => { delete target.dataset.typed })
    document.addEventListener("click", ({target}) => {
      if (target.tagName == "BUTTON" && target.dataset.action) ask(target.dataset.action)
    })
    document.addEventListener("keydown", (event) => {
      if (!(event.ctrlKey || event.metaKey) || event.target.type == "text") return
      const key = event.key.toLowerCase()
      if (key != "z" && key != "y") return
      event.preventDefault()
      ask(key == "y" || event.shiftKey ? "redo" : "undo")
    })
  })

  // The browser saves a file under its name.
  const save = (name, content) => {
    const link = document.createElement("a")
    link.href = URL.createObjectURL(new Blob([content], {type: "application/octet-stream"}))
    link.download = name
    link.click()
    setTimeout(() => URL.revokeObjectURL(link.href), 60000)
  }

  return {ask, save, show}
})()
