"""Foundation: shapes, poses, signed distance and witness points of a pair."""
