"""The models that Figure 3 holds the Cosserat rod against, each written for its purpose and sharing nothing with it.

Planar column along z, clamped at the origin, bending towards x; theta turns z towards x. Everything inside is in units
of the length L and of EI/L^2; what goes in and comes out is in SI units.

    corotational   a two-node co-rotational Timoshenko beam: the role of a commercial package's built-in beam
    mcre           a reconstruction of the Modified Cosserat Rod Element, any number of elements, and its limit
    solid_bar      the circular bar itself as a three-dimensional elastic solid
    follow         the path of any of them: load control, arc length, limit points
"""
