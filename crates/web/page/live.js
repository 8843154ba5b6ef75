// A stream of events that comes again by itself, and says whether it is there.

const SILENT_MS = 15000; // the server says at least every 5 s that it is there
const AGAIN_MS = 3000;

export class Live {
  // `handlers` by the event's name; `opened` is called whenever the stream begins (anew): what was
  // missed is to be read then.
  constructor(address, handlers, opened) {
    Object.assign(this, { address, handlers, opened, heardAt: Date.now(), ended: false });
    this.link = document.getElementById("link");
    this.watchdog = setInterval(() => this.check(), 1000);
    this.begin();
  }

  begin() {
    this.source = new EventSource(this.address);
    this.source.onopen = () => {
      this.heard();
      this.opened();
    };
    this.source.onerror = () => this.lost();
    this.source.addEventListener("beat", () => this.heard());
    for (const [name, handle] of Object.entries(this.handlers)) {
      this.source.addEventListener(name, (event) => {
        this.heard();
        handle(JSON.parse(event.data));
      });
    }
  }

  heard() {
    this.heardAt = Date.now();
    this.show("live", "good");
  }

  lost() {
    if (this.ended) return;
    this.show("connection lost; trying again", "bad lost");
    // Told to come later, or refused: a browser does not come again by itself.
    if (this.source.readyState === EventSource.CLOSED) this.again();
  }

  again() {
    this.source.close();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.begin(), AGAIN_MS);
    this.heardAt = Date.now();
  }

  check() {
    if (Date.now() - this.heardAt > SILENT_MS) {
      this.show("connection lost; trying again", "bad lost");
      this.again();
    }
  }

  show(text, kind) {
    if (this.link.textContent !== text) {
      this.link.textContent = text;
      this.link.className = kind;
    }
  }

  end() {
    this.ended = true;
    clearInterval(this.watchdog);
    clearTimeout(this.timer);
    this.source.close();
  }
}
