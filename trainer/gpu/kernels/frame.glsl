/* SPDX-License-Identifier: MIT
 *
 * What an iteration tells the kernels: the fields of one struct, read as GLSL
 * by frame_buffer.glsl and as C by gpu_frame.h. All are of 4 bytes, so both
 * lay them out alike. N_ATTRS is SAGA_N_ATTRS. */

/* The camera and the rules of canvas.h. */
float rotation[9];
float centre[3];
float focal[2];
float principal[2];
float near_plane;
float background[3];
float t;
float cut;
float alpha_cap;
float t_floor;
float low_pass;
float square;
uint detach_time;
uint order;
uint width;
uint height;
uint n_tiles_x;
uint n_tiles_y;

/* The primitives: attribute a of primitive i begins at
 * attr_at[a] + attr_width[a] i. */
uint n;          /* the pass's own, then those of the backdrop */
uint n_own;
uint attrs;      /* bit mask of the attributes that exist */
uint back_attrs; /* those of the backdrop */
uint attr_at[N_ATTRS];
uint back_at[N_ATTRS];
uint attr_width[N_ATTRS];

/* The picture. */
uint draws;      /* 1: draw the image; 0: learn from the truth */
uint most_pairs; /* room for pairs */
uint side;       /* of the boxes of stored pixels that become one */
uint stride;     /* bytes of a row of the stored picture */
float exposure[3];
uint mask_at;    /* where its mask is behind the picture; 0: it has none */
uint is_subject; /* 1: the mask is an opacity; 0: its pixels of 0 don't count */

/* The optimiser (adam.h), and the bounds of attributes. */
float beta1;
float beta2;
float eps;
float scale;     /* 1 / sqrt(1 - beta2^step) */
float most;
float rate[N_ATTRS]; /* over 1 - beta1^step; 0: no steps */
float lo[N_ATTRS];
float hi[N_ATTRS];
float n_by_ln_2; /* values of the picture, over ln 2 */
float n_seen;    /* values that count */
