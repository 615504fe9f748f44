// SPDX-License-Identifier: MIT
//
// The sound of a viewer's film. An <audio> element follows the viewer's clock:
// play, pause, seek, loop, rate, late segments.
//
//     const sound = new Sound(viewer);
//     sound.muted = true;
//
// The sound is fetched once, when it is first needed. It is silent along a path
// of key cameras, which sets the time itself, and until the browser allows
// sound, which may need a gesture of the user.
//
// Event: `change`, when exists, muted or isBlocked change.

const OFF_SECONDS = 0.08; // largest deviation from the picture's time, until it
                          // is set anew
const AGAIN_MS = 250;     // smallest interval between two such settings
const MOST_LEAD = 0.3;    // seconds
const STILL_MS = 500;     // time without a change from the clock, after which
                          // it counts as standing
const RATES = [1 / 16, 16]; // rates that browsers play
const TYPE = 'audio/ogg; codecs=opus';
const GESTURES = ['click', 'keydown'];

export class Sound extends EventTarget {
    constructor(viewer) {
        super();
        const follow = () => this.follow();

        this.viewer = viewer;
        this.audio = new Audio();
        this.wantsSilence = false;
        this.lead = 0;           // seconds that a browser needs to start the
                                 // sound
        this.unblock = () => setTimeout(() => this.allow());
        this.clear();
        viewer.addEventListener('opened', () => this.begin());
        viewer.addEventListener('sound', ({ detail }) => this.take(detail));
        for (const type of ['change', 'waiting', 'resumed'])
            viewer.addEventListener(type, follow);
        for (const type of ['loadedmetadata', 'seeked'])
            this.audio.addEventListener(type, follow);
        this.audio.addEventListener('error', () => this.clear());
    }

    // Removes the sound, until a file with sound is opened.
    clear() {
        clearTimeout(this.still);
        this.exists = false;
        this.isAsked = false;
        this.start = 0;          // time of the film at which the sound begins,
                                 // in seconds
        this.setAt = -Infinity;  // when the time of the <audio> element was
                                 // last set
        this.setTo = 0;
        this.isFresh = false;    // the sound has run since then, and `lead` is
                                 // not measured yet
        this.audio.pause();
        this.allow();
        if (this.audio.src) {
            URL.revokeObjectURL(this.audio.src);
            this.audio.removeAttribute('src');
            this.audio.load();
        }
        this.changed();
    }

    begin() {
        this.clear();
        this.exists = this.viewer.hasSound &&
            this.audio.canPlayType(TYPE) !== '';
        this.changed();
    }

    // Takes the sound from the worker, or null if it is damaged.
    take(found) {
        if (!found) {
            this.clear();
            return;
        }
        this.start = found.start;
        this.audio.src = URL.createObjectURL(
            new Blob([found.bytes], { type: TYPE }));
    }

    changed() {
        this.dispatchEvent(new Event('change'));
        this.follow();
    }

    // --- Who hears it

    get muted() { return this.wantsSilence; }
    set muted(muted) {
        this.wantsSilence = Boolean(muted);
        this.changed();
    }

    // Returns whether the sound is heard while the film plays.
    get isHeard() {
        return this.exists && !this.muted && !this.isBlocked;
    }

    // Turns the sound on or off for the user. The click is also a gesture that
    // lets the browser play sound.
    toggle() {
        const muted = this.isHeard;

        this.allow();
        this.muted = muted;
    }

    // Waits for a gesture: browsers refuse sound until the user has done
    // something on the page.
    block() {
        this.isBlocked = true;
        for (const type of GESTURES)
            document.addEventListener(type, this.unblock);
        this.changed();
    }

    // Unblocks the sound after a gesture. A gesture that mutes the sound gets
    // here after it has done so.
    allow() {
        const wasBlocked = this.isBlocked;

        this.isBlocked = false;
        for (const type of GESTURES)
            document.removeEventListener(type, this.unblock);
        if (wasBlocked)
            this.changed();
    }

    // --- The clock

    // Plays, pauses and sets the time according to the viewer's clock.
    follow() {
        const { viewer, audio } = this;
        const isWanted = this.isHeard && viewer.playing && !viewer.path;

        if (isWanted && !this.isAsked) {
            this.isAsked = true;
            viewer.askSound();
        }
        if (!viewer.info ||
            audio.readyState < HTMLMediaElement.HAVE_METADATA)
            return;
        const seconds = viewer.frame / viewer.info.fps - this.start;
        const runs = isWanted && this.setRate(viewer.rate) &&
            seconds >= 0 && seconds < audio.duration;

        clearTimeout(this.still);
        if (runs)
            this.still = setTimeout(() => audio.pause(), STILL_MS);
        if (runs || !viewer.playing)
            this.setTime(seconds, runs);
        this.run(runs && !viewer.waiting && !this.isEarly(seconds));
    }

    // Sets the rate of playback. Returns whether the browser can play at it.
    setRate(rate) {
        const can = rate >= RATES[0] && rate <= RATES[1];

        if (can)
            this.audio.playbackRate = rate;
        return can;
    }

    // Returns whether the sound is ahead of a picture that is late. Sound that
    // has been played is then not played again.
    isEarly(seconds) {
        return this.viewer.isLate() &&
            this.audio.currentTime > seconds + OFF_SECONDS;
    }

    // Sets the time. If the film runs, it is set to the time that the picture
    // will have when the sound starts.
    setTime(seconds, runs) {
        const { audio } = this;
        const now = performance.now();
        const place = (time) => Math.max(0, Math.min(time, audio.duration));

        if (audio.seeking || (runs && now - this.setAt < AGAIN_MS))
            return;
        this.measureLead(now);
        if (Math.abs(audio.currentTime - place(seconds)) < OFF_SECONDS ||
            (runs && this.isEarly(seconds)))
            return;
        this.setAt = now;
        this.setTo = place(
            runs ? seconds + this.lead * audio.playbackRate : seconds);
        this.isFresh = runs;
        audio.currentTime = this.setTo;
    }

    // Measures `lead`: the seconds since the time was set, minus the seconds
    // played since then.
    measureLead(now) {
        const { audio } = this;
        const played = (audio.currentTime - this.setTo) / audio.playbackRate;

        if (this.isFresh)
            this.lead = Math.max(0, Math.min(
                (now - this.setAt) / 1000 - played, MOST_LEAD));
        this.isFresh = false;
    }

    // Starts or stops the sound. At its end it is not started, since an <audio>
    // element would begin anew.
    run(runs) {
        const { audio } = this;

        this.isFresh &&= runs;
        if (!runs)
            audio.pause();
        else if (audio.paused && !audio.ended)
            audio.play().catch(({ name }) => {
                if (name === 'NotAllowedError')
                    this.block();
            });
    }
}
