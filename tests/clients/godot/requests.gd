extends SceneTree
## Asks the service what the test says, all at once, and tells the answers in their order. The one argument is JSON:
## {ingress, egress, control, requests: [[cmd, args, timeout_s], ...], leave?}; with `leave` the client leaves the scene.

const Client := preload("res://addons/foottrack/foottrack_client.gd")

var _answers := {}


func _initialize() -> void:
	var settings: Dictionary = JSON.parse_string(OS.get_cmdline_user_args()[0])
	var client := Client.new()
	client.ingress_port = settings["ingress"]
	client.egress_port = settings["egress"]
	client.control_port = settings["control"]
	root.add_child(client)
	# Nothing is in the tree before the first frame.
	await process_frame
	var requests: Array = settings["requests"]
	for i in requests.size():
		_ask(client, i, requests[i], requests.size())
	if settings.get("leave", false):
		root.remove_child(client)
		client.free()


func _ask(client: Client, number: int, request: Array, due: int) -> void:
	_answers[number] = await client.request(request[0], request[1], request[2])
	if _answers.size() == due:
		var said := []
		for i in due:
			said.append(_answers[i])
		print("LINE " + JSON.stringify({"kind": "answers", "answers": said}))
		quit()
