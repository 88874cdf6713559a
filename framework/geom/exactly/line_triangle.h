/* Where a line parallel to the first axis meets a triangle: exact decisions (predicates.h). */
#ifndef SDM_GEOM_LINE_TRIANGLE_H
#define SDM_GEOM_LINE_TRIANGLE_H

/* Does the line through p (second and third coordinate) meet the triangle v? 0, or the sign of the
   triangle's orientation as seen along the line: +1 where it points the way of the line. The line
   is moved by an infinitely small amount, so that it never meets an edge or a corner: of a closed
   mesh it meets every sheet once. area[i]: rounded area opposite to corner i. */
int sdm_line_meets(const double v[3][3], const double p[2], double area[3]);

/* Where the line through p (three coordinates) meets v, which it does with `orientation` and
   `area`: the sign of that place's first coordinate minus p[0]; 0 where p lies on the triangle. */
int sdm_line_meets_after(const double v[3][3], const double p[3], int orientation,
                         const double area[3]);

#endif
