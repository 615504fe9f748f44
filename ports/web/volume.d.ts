// SPDX-License-Identifier: MIT
import type { SagaViewingVolume } from './saga.js';

/** Where an eye is in a viewing volume; angles in radians, distance in the
 * capture's unit. */
export interface SagaEyePlace {
    azimuth: number;
    elevation: number;
    distance: number;
}

/** Returns the position of an eye in the capture's unit. */
export function eyeAt(volume: SagaViewingVolume, place: SagaEyePlace): number[];
/** Returns where a position in the capture's unit is. */
export function placeOf(volume: SagaViewingVolume, eye: number[]): SagaEyePlace;
/** Returns the place inside the volume that is nearest in each of the three. */
export function inside(volume: SagaViewingVolume,
    place: SagaEyePlace): SagaEyePlace;
/** Returns how far an eye, which looks in the direction `forward`, is outside,
 * in radians; 0 is inside. */
export function outside(volume: SagaViewingVolume, eye: number[],
    forward?: number[]): number;
/** Returns the PSNR that may be expected at an eye, in dB, or null if the film
 * does not say. eyes: the positions of the cameras that were trained on;
 * without any, it is what is expected between cameras. */
export function expectedPsnr(volume: SagaViewingVolume, eyes: number[][],
    eye: number[]): number | null;
