// SPDX-License-Identifier: MIT
//
// A .saga film as a component of A-Frame, which is loaded before:
//
//     <a-entity saga="src: scene.saga" position="0 1.6 0"></a-entity>
//
// The film stands upright, in metres. Its first camera is at the entity's
// position and looks to where the entity's -z is.

import { Matrix4 } from 'three';
import { standing } from 'saga-web/xr.js';
import { SagaMesh } from './saga_three.js';

const OBJECT = 'saga'; // the name of the entity's object
const { AFRAME } = globalThis;

// What renders pages on a server may import the module without A-Frame.
if (!AFRAME && globalThis.document)
    throw new Error('saga_aframe.js: load A-Frame before this module');
AFRAME?.registerComponent('saga', {
    schema: {
        src: { type: 'string' },
        autoplay: { default: true },
        loop: { default: true },
    },

    // Tells `model-loaded` or `model-error`, as A-Frame's own models do.
    async update({ src: before }) {
        const { src } = this.data;

        if (src === before || !src) {
            this.follow();
            return;
        }
        this.remove();
        const film = new SagaMesh();

        this.film = film;
        try {
            await film.view.open(src);
        } catch ({ message }) {
            this.el.emit('model-error', { src, message });
            return;
        }
        film.applyMatrix4(new Matrix4().fromArray(
            standing(film.view, new Matrix4().elements)));
        this.el.setObject3D(OBJECT, film);
        this.follow();
        if (this.data.autoplay)
            film.view.play();
        this.el.emit('model-loaded', { format: 'saga', model: film });
    },

    follow() {
        if (this.film)
            this.film.view.loop = this.data.loop;
    },

    remove() {
        if (this.el.getObject3D(OBJECT))
            this.el.removeObject3D(OBJECT);
        this.film?.dispose();
        this.film = null;
    },
});
