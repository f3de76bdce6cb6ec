extends SceneTree
## What a client says that is in no scene: before it enters one, within, and after it has left it. What others that still
## hold it may ask must not be an error.

const Client := preload("res://addons/foottrack/foottrack_client.gd")
const Message := preload("res://addons/foottrack/wire/message.gd")


func _initialize() -> void:
	var client := Client.new()
	# Nobody is there.
	client.ingress_port = 1
	client.egress_port = 1
	client.control_port = 1
	var before := _ask(client)
	root.add_child(client)
	await process_frame
	_ask(client)
	root.remove_child(client)
	print("LINE " + JSON.stringify({"before": before, "after": _ask(client)}))
	client.free()
	quit()


func _ask(client: Client) -> Dictionary:
	var message := Message.new()
	message.arrival_usec = Time.get_ticks_usec() - 1_000_000
	client.publish("head/pose", Time.get_ticks_usec(), {"tracked": false})
	return {
		"synchronised": client.is_synchronised(),
		"connected": client.is_connected_to_bus(),
		"age": client.age(message),
		"bus_time": client.bus_time() > 0,
		"statistics": client.statistics(),
	}
