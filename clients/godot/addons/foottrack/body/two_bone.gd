extends RefCounted
## A leg of two bones that reaches a point and bends towards a pole, in closed form.

## A straight leg shakes: it is bent a little before it is fully stretched.
const MOST_REACH := 0.999


## Where the ankle gets, seen from `hip`: as near to `ankle` as bones of these lengths can.
static func reach(hip: Vector3, ankle: Vector3, thigh: float, shank: float) -> Vector3:
	var way := ankle - hip
	var distance := way.length()
	if distance < 1e-6:
		return hip + Vector3.DOWN * maxf(absf(thigh - shank), 1e-6)
	return hip + way / distance * clampf(distance, absf(thigh - shank), MOST_REACH * (thigh + shank))


## Which way the knee bends: the unit vector towards `pole`, at right angles to hip - ankle. `otherwise` is the
## direction when the pole lies on that line.
static func bend(hip: Vector3, ankle: Vector3, pole: Vector3, otherwise: Vector3) -> Vector3:
	var along := (ankle - hip).normalized()
	for wish: Vector3 in [pole - hip, otherwise, along.cross(Vector3.RIGHT), Vector3.FORWARD]:
		var across := wish - along * wish.dot(along)
		if across.length_squared() > 1e-8:
			return across.normalized()
	return otherwise


## The knee of a leg whose ankle is within reach.
static func knee(hip: Vector3, ankle: Vector3, thigh: float, shank: float, bent: Vector3) -> Vector3:
	var way := ankle - hip
	var distance := maxf(way.length(), 1e-6)
	var along := (thigh * thigh - shank * shank + distance * distance) / (2.0 * distance)
	return hip + way / distance * along + bent * sqrt(maxf(thigh * thigh - along * along, 0.0))


## A bone's frame: +Y from one joint to the next, +Z where the knee bends to.
static func frame(from: Vector3, to: Vector3, bent: Vector3) -> Basis:
	var y := (to - from).normalized()
	var z := (bent - y * bent.dot(y)).normalized()
	return Basis(y.cross(z), y, z)
