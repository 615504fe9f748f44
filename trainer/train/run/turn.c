/* SPDX-License-Identifier: MIT
 *
 * A turn is the training of one segment or of the base. The first segment to be
 * trained and the existence of a base determine which one.
 */
#include "train_state.h"

/* With a base there are two more turns: the base, and a second one for the
 * first segment. */
int saga_train_n_turns(const saga_train *t, bool has_base)
{
    return t->o.n_segments + (has_base ? 2 : 0);
}

int saga_train_segment_at(int first, int turn, bool has_base)
{
    /* Without a base, all segments except the first follow in order of time.
     * With one, turn 1 is the base, and all segments follow, including the
     * first. */
    return turn == 0   ? first
           : !has_base ? (turn <= first ? turn - 1 : turn)
           : turn == 1 ? SAGA_TRAIN_BASE
                       : turn - 2;
}

int saga_train_segment(const saga_train *t)
{
    return t->turn > 0 && t->o.networks
               ? t->o.only
               : saga_train_segment_at(t->o.first, t->turn, t->base.n_prim > 0);
}

int saga_train_first(const saga_train *t)
{
    return t->o.first;
}

int saga_train_upcoming(const saga_train *t)
{
    const bool has_base = t->base.n_prim > 0;

    return t->turn + 1 < saga_train_n_turns(t, has_base) && !t->o.networks
               ? saga_train_segment_at(t->o.first, t->turn + 1, has_base)
               : -1;
}

bool saga_train_in_base(const saga_train *t)
{
    return t->base.n_prim && t->turn == 1 && !t->o.networks;
}
