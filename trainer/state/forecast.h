/* Tells early that the maps which are made in any case do not fit into a budget of time. */
#pragma once

#include "trainer.h"

/* true: `all` maps, of which `done` were made since `since` (s, of trainer_seconds()), will take
   more than the rest of the budget of time at this pace. *seconds = the time of the run at their
   end. false: they fit, the budget is no time, or too few maps were made to tell. */
bool trainer_forecast(const trainer *t, double since, size_t done, size_t all, double *seconds);
