"""Rooms out of flights: depth maps of keyframes, fused into a surface, and its errors beside the
exact surfaces of rendered rooms."""
