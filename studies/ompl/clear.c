/* Whether a polyline surely keeps clear of boxes and stays where the platform can be held.

   scene: the distance to keep, the margin beyond it that is kept away from the ends, start, goal,
   then centre and half sizes of each box. lattice: its first place, its spacing, its three sizes;
   rest: at each of its places the room that the platform has at rest there. Lengths in m. */

#include <math.h>

static double room(const double *x, const double *scene, long boxes)
{
    const double *start = scene + 2, *goal = scene + 5;
    double nearest = 1e9, from_start = 0, from_goal = 0;
    for (const double *box = scene + 8; box < scene + 8 + 6 * boxes; box += 6) {
        double outside = 0, inside = -1e9;
        for (int i = 0; i < 3; i++) {
            double d = fabs(x[i] - box[i]) - box[3 + i];
            outside += d > 0 ? d * d : 0;
            inside = fmax(inside, d);
        }
        nearest = fmin(nearest, inside > 0 ? sqrt(outside) : inside);
    }
    for (int i = 0; i < 3; i++) {
        from_start += (x[i] - start[i]) * (x[i] - start[i]);
        from_goal += (x[i] - goal[i]) * (x[i] - goal[i]);
    }
    double end = sqrt(fmin(from_start, from_goal));
    return nearest - scene[0] - fmin(scene[1], end / 2);
}

/* Interpolated between eight places of the lattice; there where start or goal is near. */
static int is_held(const double *x, const double *scene, const float *rest, const double *lattice)
{
    double spacing = lattice[3], share[3], near_start = 0, near_goal = 0, found = 0;
    long first[3];
    for (int i = 0; i < 3; i++) {
        near_start += pow(x[i] - scene[2 + i], 2);
        near_goal += pow(x[i] - scene[5 + i], 2);
        share[i] = (x[i] - lattice[i]) / spacing;
        first[i] = (long)floor(share[i]);
        share[i] -= first[i];
    }
    if (fmin(near_start, near_goal) < spacing * spacing)
        return 1;
    for (int corner = 0; corner < 8; corner++) {
        double weight = 1;
        long place = 0;
        for (int i = 0; i < 3; i++) {
            long next = corner >> i & 1, size = (long)lattice[4 + i], k = first[i] + next;
            if (k < 0 || k >= size)
                return 0;
            weight *= next ? share[i] : 1 - share[i];
            place = place * size + k;
        }
        found += weight * rest[place];
    }
    return found > 0;
}

/* Steps are no longer than the room at their beginning allows: it changes by at most 1.5 times the
   way. Where there is less than 0.01 mm it counts as blocked. */
int is_clear(const double *points, long count, const double *scene, long boxes,
             const float *rest, const double *lattice)
{
    for (long k = 0; k < (count > 1 ? count - 1 : 1); k++) {
        const double *a = points + 3 * k, *b = count > 1 ? a + 3 : a;
        double length = sqrt(pow(b[0] - a[0], 2) + pow(b[1] - a[1], 2) + pow(b[2] - a[2], 2));
        for (double way = 0; way <= length;) {
            double x[3], share = length > 0 ? way / length : 0;
            for (int i = 0; i < 3; i++)
                x[i] = a[i] + share * (b[i] - a[i]);
            double free = room(x, scene, boxes);
            if (free < 0 || !is_held(x, scene, rest, lattice))
                return 0;
            if (way == length)
                break;
            way = fmin(length, way + fmax(1e-5, fmin(free / 1.5, lattice[3])));
        }
    }
    return 1;
}
