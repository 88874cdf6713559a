/* Tells early whether the maps of a training fit into a budget of time, and how many minutes hold
   them. */
#pragma once

#include "trainer.h"

/* true: `all` maps, of which `done` were made since `since` (s, of trainer_seconds()), will take
   more than the rest of the budget of time at this pace. *seconds = the time of the run at their
   end. false: they fit, the budget is no time, or too few maps were made to tell. */
bool trainer_forecast(const trainer *t, double since, size_t done, size_t all, double *seconds);

/* Number of training maps that n_params parameters ask for with a network `pod`: four for each
   term of the polynomials of network.degree, at most data.start. */
double trainer_maps_asked(const sdm_config *pod, size_t n_params);

/* train.minutes that hold so many maps of `per_map` seconds, which have half of the time, and
   `after` seconds of bases, with a third of the time for steps. Rounded up. */
double trainer_minutes_for(double maps, double per_map, double after);

/* The same for a training of kind `pod` that had fewer maps than asked for, at its own pace; 0: it
   had enough, it is of another kind, or the budget is no time. */
double trainer_minutes_asked(const trainer *t);

/* Tells once, with a budget of time, how many maps of `per_map` seconds fit into `seconds`, and
   how many the parameters ask for. Returns about the minutes that hold these; 0: all fit. The end
   of a run measures them. */
double trainer_tell_pace(trainer *t, const sdm_config *pod, double per_map, double seconds);
