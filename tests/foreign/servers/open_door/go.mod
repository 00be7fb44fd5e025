module open_door

go 1.19
