// The lab in a notebook: its page in a frame of its own, whose questions go to the kernel.
const HEIGHT = "740px";

export default {
  render({ model, el }) {
    const frame = document.createElement("iframe");
    frame.sandbox = "allow-scripts allow-downloads";
    Object.assign(frame.style, { width: "100%", height: HEIGHT, border: "0" });
    frame.srcdoc = model.get("page");
    const ask = (event) => { if (event.source === frame.contentWindow) model.send(event.data); };
    const answer = (said, [body]) => frame.contentWindow?.postMessage({ ...said, body }, "*");
    window.addEventListener("message", ask);
    model.on("msg:custom", answer);
    el.append(frame);
    return () => {
      window.removeEventListener("message", ask);
      model.off("msg:custom", answer);
    };
  },
};
