/* Units of length that files and plug-ins use by mistake: sdmgen has mm alone. */
#pragma once

#ifdef __cplusplus
extern "C" {
#endif

/* The unit (m, inches, cm, um) whose length is nearest to `mm`, by its factor; NULL: none is within
 * a factor of 2.5. *length, unless NULL, becomes its length in mm. [any thread] */
const char *sdm_unit_near(double mm, double *length);

#ifdef __cplusplus
}
#endif
