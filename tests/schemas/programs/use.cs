using SplatBus;

public static class Use
{
    static string Told(IIpcFromServer message)
    {
        var frame = message as Frame;
        if (frame != null) return frame.Type + " " + frame.Seq + " " + frame.Camera.Tag;
        var packet = message as InitPacket;
        var memory = packet == null ? null : packet.Memory as HostShmMemory;
        if (memory != null) return memory.Kind + " " + memory.Name + " " + packet.Ring.Slots;
        return message.GetType().Name;
    }

    public static void Main()
    {
        System.Console.WriteLine(Told(new Frame { Seq = 7, Camera = new FrameCamera { Tag = "a" } }));
        System.Console.WriteLine(Told(new InitPacket {
            Generation = 1,
            Meta = new Meta { W = 64, H = 48 },
            Memory = new HostShmMemory { Name = "splat", Bytes = 61440 },
            Ring = new Ring { Slots = 3 },
            Semantics = new Semantics { Alpha = SemanticsAlpha.Straight, UnitMetres = null },
        }));
        System.Console.WriteLine(Told(new Error { Code = ErrorCode.Busy, Id = null }));
        System.Console.WriteLine(WireNames.Of("MemColor") + " " + WireNames.Of("ColorOffset"));
        var packet = new byte[Framing.HeaderBytes + Limits.MinPayloadBytes];
        int port = Framing.IpcPort;
        System.Console.WriteLine(Limits.MaxPayloadBytes + " " + port + " " + packet.Length);
    }
}
