// Return a function that asks a worker, in the order of the calls. Pages from disk can make a worker of text only: that of
// a function, which returns what can be asked by name.
const asker = (working) => {
  const text = `const answers = (${working})();
onmessage = async ({ data: [number, name, given] }) => {
  try {
    postMessage([number, await answers[name](given)]);
  } catch (error) {
    postMessage([number, null, error.message]);
  }
};`;
  const worker = new Worker(URL.createObjectURL(new Blob([text], { type: "text/javascript" })));
  const waiting = new Map();
  let number = 0;
  worker.onmessage = ({ data: [of, answer, wrong] }) => {
    const { resolve, reject } = waiting.get(of);
    waiting.delete(of);
    if (wrong === undefined) resolve(answer); else reject(new Error(wrong));
  };
  worker.onerror = (event) => {
    event.preventDefault();
    for (const { reject } of waiting.values()) reject(new Error(event.message));
  };
  return (name, given) => new Promise((resolve, reject) => {
    waiting.set(number, { resolve, reject });
    worker.postMessage([number++, name, given]);
  });
};
